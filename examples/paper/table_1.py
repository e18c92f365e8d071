"""Table 1: steps a second over resolution and polygon count; and what comes before the first step.

python examples/paper/table_1.py
"""

from pathlib import Path

from page import Part

from ripple_sim.bench.report import RESOLUTIONS, steps_per_second

PAPER = {"polygons": "21,338", "texels": "15,000", "seconds": "177"}


def make(folder: Path) -> Part:
    table = steps_per_second()
    rows = [["polygons", *(f"N = {n}" for n in RESOLUTIONS), "sphere map", "atlas N = 56"]]
    for count, row in table.items():
        rows.append(
            [
                f"{int(count):,}",
                *(f"{row[f'steps/s {n}']:,.0f}" for n in RESOLUTIONS),
                f"{row['sphere map [s]']:.2f} s",
                f"{row['atlas 56 [s]']:.3f} s",
            ]
        )
    return Part(
        "Table 1: steps per second, and the precomputation",
        "Wave steps per second on the CPU, without rendering. The polygons matter in the precomputation only: the "
        f"waves run on texels. The paper gives {PAPER['seconds']} s for casting the rays of {PAPER['texels']} texels "
        f"against each of {PAPER['polygons']} polygons; an atlas of N = 56 has 18,816 texels.",
        table=rows,
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
