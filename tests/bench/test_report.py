"""A report can be read."""

import dataclasses

from ripple_sim.bench.arrival import ArrivalError
from ripple_sim.bench.report import as_text

CPU_ROW = {"threads": 2, "cpu": 6e8, "cpu 1": 3.75e8, "naive": 5e8, "naive 1": 2.5e8, "naive prange": 5e8}
CPU_ROW |= {"stream": 8e8, "stream 1": 4e8, "scipy": 3e7}
CPU_ROW |= {"over naive": 1.2, "one thread over naive": 1.5, "all threads over naive": 1.21}
CPU_ROW |= {"of stream": 0.75, "one thread of stream": 0.94}
CPU_ROW |= {"one thread over scipy": 12.5}
ERROR = dataclasses.asdict(ArrivalError(0.004, 0.01, 0.99, 0.01, 0.02, 0.95))


def test_report_reads_as_text() -> None:
    sphere = {"16": 0.1, "32": 0.03, "order": 1.9}
    cost = {"touching": 3.2, "mj_step [s]": 2e-3, "coupling [s]": 3e-4, "waves [s]": 2e-4, "of mj_step": 0.15}
    row = {f"steps/s {n}": 1234.5 for n in (20, 28, 40, 56, 128, 256, 512)}
    text = as_text(
        {
            "machine": {"version": "1", "processors": 2, "renderer": "none"},
            "cpu": {"256": CPU_ROW},
            "gl": {"256": None},
            "table": {"2700": row | {"sphere map [s]": 0.1, "atlas 512 [s]": 1.0}},
            "coupling": {"dish": cost},
            "sphere": {"fem": sphere, "paper": {"16": 0.1, "order": 0.0}},
            "energy": {"steps": 10_000, "largest": 1e-7, "trend": -2e-8},
            "arrival": {"cat": {"fem": ERROR, "calibrated": ERROR | {"speed factor": 1.27}, "conformal": None}},
        }
    )
    assert text.index("naive") < text.index("memory bound") < text.index("scipy")  # the true rival first
    cpu = ("1.20", "1.21", "500 (prange)", "0.94", "12.50")
    for figure in (*cpu, "0.300", "1,234", "1.0e-07", "0.40 %", "paper", "x 1.270", "folds"):
        assert figure in text
