"""The benchmark: that its rivals compute the same, and that its report can be read."""

import dataclasses

import numpy as np
import pytest

from ripple_sim.bench.arrival import ArrivalError
from ripple_sim.bench.coupling import coupling_cost
from ripple_sim.bench.report import as_text
from ripple_sim.bench.rivals import PlainShader, SparseLeapfrog
from ripple_sim.bench.table import POLYGONS, knobbly_body
from ripple_sim.solver import GLError, Material, sphere_atlas
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.operator.assembly import build_operator


def test_sparse_matrix_gives_the_same_waves() -> None:
    n = 16
    operator = build_operator(sphere_atlas(1.0, n), Material(), "fem")
    start = np.random.default_rng(0).standard_normal((6, n, n)).astype(np.float32)
    rival, solver = SparseLeapfrog(operator), make_backend("cpu", operator)
    rival.h[:] = start.ravel()
    solver.set_height(start)
    dt = operator.stable_timestep / 2
    for _ in range(40):
        rival.advance(1, dt)
    solver.advance(40, dt)
    # the rival drifts a whole step after each kick, the solver half a step before and half a step after
    drifted = rival.h - dt / 2 * rival.v
    assert np.abs(drifted - solver.height().ravel()).max() < 1e-4 * np.abs(start).max()


def test_plain_shader_runs() -> None:
    operator = build_operator(sphere_atlas(1.0, 16), Material(), "fem")
    try:
        PlainShader(operator).advance(3, 0.01)
    except GLError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("count", POLYGONS)
def test_bodies_have_the_polygons_they_are_asked_for(count: int) -> None:
    assert len(knobbly_body(count).F) == count


def test_coupling_is_measured_on_bodies_that_touch() -> None:
    row = coupling_cost(["dish"], seconds=0.7, bodies=3, resolution=16)["dish"]
    assert row["touching"] > 0
    assert row["of mj_step"] == pytest.approx(row["coupling [s]"] / row["mj_step [s]"])


CPU_ROW = {"cpu": 6e8, "one thread": 3e8, "copy": 4e8, "scipy": 3e7}
CPU_ROW |= {"of copy": 0.75, "over scipy": 20.0, "one thread over scipy": 10.0}


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
            "arrival": {"cat": {"fem": dataclasses.asdict(ArrivalError(0.004, 0.01, 0.99, 0.01, 0.02, 0.95))}},
        }
    )
    for piece in ("0.75", "20.00", "0.300", "1,234", "1.0e-07", "0.40 %", "paper"):
        assert piece in text
