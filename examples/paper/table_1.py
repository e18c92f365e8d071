"""Table 1: steps a second over resolution and polygon count; and what comes before the first step.

python examples/paper/table_1.py
"""

import sys
import time
from pathlib import Path

import numpy as np
from page import Part

from ripple_sim.solver import Material, build_atlas, build_operator
from ripple_sim.solver.backends import make_backend
from ripple_sim.solver.layouts import atlas_from_sphere_map

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from drawn_steps import POLYGONS, RESOLUTIONS, knobbly_body

PAPER = {"polygons": "21,338", "texels": "15,000", "seconds": "177"}

_SECONDS = 0.1


def steps_per_second(
    resolutions: tuple[int, ...] = RESOLUTIONS,
    polygons: tuple[int, ...] = POLYGONS,
    backend: str = "cpu",
) -> dict[str, dict[str, float]]:
    """Substeps a second, and seconds for the atlas, by polygon count and resolution."""
    table = {}
    for count in polygons:
        start = time.perf_counter()
        atlas = build_atlas(knobbly_body(count), resolutions[0], cache=False, layout="cube")
        row = {"sphere map [s]": time.perf_counter() - start}
        for n in resolutions:
            start = time.perf_counter()
            texels = atlas_from_sphere_map(atlas.mesh, atlas.sphere, n)
            operator = build_operator(texels, Material(), "fem")
            row[f"atlas {n} [s]"] = time.perf_counter() - start
            solver = make_backend(backend, operator)
            # steps of a surface at rest cost nothing
            solver.set_velocity(np.ones(operator.mass.shape, np.float32))
            solver.advance(4, 1e-6)
            steps = 4
            best = np.inf
            until = time.perf_counter() + _SECONDS
            while time.perf_counter() < until:
                start = time.perf_counter()
                solver.advance(steps, 1e-6)
                solver.wait()
                best = min(best, (time.perf_counter() - start) / steps)
                steps = max(4, min(200, int(_SECONDS / 5 / best)))
            row[f"steps/s {n}"] = 1 / best
        table[str(count)] = row
    return table


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
        "The table lists wave steps per second on the CPU, without rendering. The number of "
        "polygons matters in the precomputation only, since the waves run on texels. The paper "
        f"needs {PAPER['seconds']} s to cast the rays of {PAPER['texels']} texels against each of "
        f"{PAPER['polygons']} polygons. An atlas of N = 56 has 18,816 texels.",
        table=rows,
    )


if __name__ == "__main__":
    from run import alone

    alone(make)
