"""How exact are the frequencies of plates, against published ones?

    python examples/benchmarks/plates.py [--resolutions 32 64] [--cost]

Square plates on patches with each kind of rim, in the units of the tables that they are compared
with, and a round one whose texels lie on the true disk. lambda^2 is the angular frequency times
side^2 (radius^2) over sqrt(D / sigma). With --cost: time of a step beside that of the same plate
without rims of its own, which is "fixed".
"""

import argparse
import dataclasses
import time
from collections.abc import Callable

import numpy as np
from eigenvalues import disk, on_disk, placed, square

from ripple_sim.solver import Atlas, Material, Mesh, WaveSolver, build_atlas, modes

NAFEMS = Material.plate(modulus=200e9, thickness=0.05, density=8000.0, poisson=0.3)
BIRGER = Material.plate(modulus=210e9, thickness=0.01, density=7800.0, poisson=0.3)
UNIT = Material(speed=0.0, bending=1.0, poisson=0.3)


def on_one_side(points: np.ndarray) -> np.ndarray:
    """A cantilever's rim: clamped where x is least, free elsewhere."""
    return points[:, 0] < 1e-6


@dataclasses.dataclass(frozen=True)
class Plate:
    """A published table: side [m] (0: the unit disk), material, rim, unit and frequencies."""

    side: float
    material: Material
    rim: str | Callable
    unit: float
    table: tuple[float, ...]


PLATES = {
    "supported [Hz], NAFEMS": Plate(
        10.0,
        NAFEMS,
        "supported",
        2 * np.pi,
        (2.377, 5.942, 5.942, 9.507, 11.884, 11.884, 15.449, 15.449),
    ),
    "free [Hz], NAFEMS FV12": Plate(
        10.0, NAFEMS, "free", 2 * np.pi, (1.622, 2.360, 2.922, 4.233, 4.233, 7.416)
    ),
    "free, lambda^2, Barton": Plate(1.0, UNIT, "free", 1.0, (13.49, 19.79, 24.43, 35.02, 35.02)),
    "free, lambda^2, Leissa": Plate(
        1.0, UNIT, "free", 1.0, (13.468, 19.596, 24.270, 34.801, 34.801, 61.093)
    ),
    "cantilever, lambda^2, Barton": Plate(
        1.0, UNIT, on_one_side, 1.0, (3.492, 8.525, 21.43, 27.33, 31.11, 54.44)
    ),
    "clamped [rad/s], Birger": Plate(
        1.0, BIRGER, "clamped", 1.0, (560.1, 1143.2, 1143.2, 1686.6, 2054.0, 2054.0)
    ),
    "clamped, lambda^2, Leissa": Plate(
        1.0, UNIT, "clamped", 1.0, (35.992, 73.413, 73.413, 108.27, 131.64, 132.24)
    ),
    "disk, supported, lambda^2, Leissa": Plate(
        0.0, UNIT, "supported", 1.0, (4.935, 13.898, 13.898, 25.613, 25.613, 29.720)
    ),
    "disk, free, lambda^2, Leissa": Plate(
        0.0, UNIT, "free", 1.0, (5.358, 5.358, 9.003, 12.439, 12.439)
    ),
    "disk, clamped, lambda^2, Leissa": Plate(
        0.0, UNIT, "clamped", 1.0, (10.216, 21.26, 21.26, 34.88, 34.88, 39.771)
    ),
}


def atlas_of(plate: Plate, resolution: int) -> Atlas:
    if not plate.side:
        return placed(build_atlas(disk(), resolution, layout="patches"), on_disk)
    mesh = square()
    return build_atlas(Mesh.from_arrays(plate.side * mesh.V, mesh.F), resolution, layout="patches")


def frequencies(plate: Plate, atlas: Atlas) -> np.ndarray:
    """The lowest modes, in the table's unit."""
    return (
        modes(atlas, plate.material, len(plate.table), rim=plate.rim).frequencies
        * 2
        * np.pi
        / plate.unit
    )


def row(name: str, values: np.ndarray, digits: int) -> str:
    return f"{name:<34}" + "".join(f"{value:9.{digits}f}" for value in values)


def print_cost(resolution: int) -> None:
    atlas = atlas_of(PLATES["free, lambda^2, Barton"], resolution)
    rims = ("fixed", "free", "supported", "clamped")
    solvers = {rim: WaveSolver(atlas, UNIT, backend="cpu", rim=rim) for rim in rims}
    for waves in solvers.values():
        waves.velocity = 1e-3  # steps of a surface at rest cost nothing
    least = dict.fromkeys(rims, np.inf)
    for _ in range(20):
        for rim, waves in solvers.items():
            step = 20 * waves.stable_timestep
            begun = time.process_time()
            waves.step(step, 20)
            least[rim] = min(least[rim], time.process_time() - begun)
    for rim in rims[1:]:
        steps = solvers["fixed"].stable_timestep / solvers[rim].stable_timestep
        cost = least[rim] / least["fixed"]
        print(
            f"N = {resolution}, {rim}: a step takes {cost:.2f} times as long, a second "
            f"{cost * steps:.2f} times"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description="Frequencies of plates against published ones.")
    parser.add_argument("--resolutions", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--cost", action="store_true")
    options = parser.parse_args()
    if options.cost:
        for n in options.resolutions:
            print_cost(n)
        return
    atlases: dict[tuple[float, int], Atlas] = {}
    for name, plate in PLATES.items():
        print(row(name, np.array(plate.table), 3))
        for n in options.resolutions:
            if (plate.side, n) not in atlases:
                atlases[plate.side, n] = atlas_of(plate, n)
            found = frequencies(plate, atlases[plate.side, n])
            print(row(f"  N = {n}", found, 3))
            print(row("    off by [%]", 100 * (found / plate.table - 1), 2), flush=True)


if __name__ == "__main__":
    main()
