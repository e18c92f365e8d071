"""A deformation model of your own: a spring that hardens, set as pressure before every step.

    python examples/own_deformation.py

Makes out/own_deformation.png: how the middle of a dent moves under no spring, a linear one and a
hardening one. The solver carries the waves; any law that gives a pressure from heights and
velocities, texel by texel, can be added.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ripple_sim.solver import Material, WaveSolver, sphere_atlas

# kg/m^2, s, s
DENSITY = 100.0
STEP = 0.002
DURATION = 1.5
# Pa/m, Pa/m^3
LINEAR = 2e4
CUBIC = 2e8

Field = NDArray[np.float64]
Law = Callable[[Field], Field]


def no_spring(height: Field) -> Field:
    return np.zeros_like(height)


def linear(height: Field) -> Field:
    return LINEAR * height


def hardening(height: Field) -> Field:
    return LINEAR * height + CUBIC * height**3


def motion(law: Law) -> Field:
    """Height [m] of the texel in the middle of the dent, step by step."""
    atlas = sphere_atlas(0.5, 48)
    waves = WaveSolver(atlas, Material(speed=0.3, damping=0.6, density=DENSITY), backend="cpu")
    where = waves.add_impulse((0.0, 0.0, 0.5), 1.5, radius=0.15)
    middle = where.texels[np.argmax(where.weights)]
    heights = []
    for _ in range(round(DURATION / STEP)):
        # positive presses inwards: against what stands out
        waves.pressure = law(waves.height.astype(np.float64))
        waves.step(STEP)
        heights.append(float(waves.height.ravel()[middle]))
    return np.array(heights)


def main() -> None:
    figure = Figure(figsize=(9, 4.2), dpi=110, layout="constrained")
    axes = figure.subplots()
    times = STEP * np.arange(1, round(DURATION / STEP) + 1)
    for law, color in ((no_spring, "#9aa3ad"), (linear, "#1f6f8b"), (hardening, "#d1495b")):
        heights = motion(law)
        axes.plot(times, 1000 * heights, color=color, label=law.__name__.replace("_", " "))
        print(f"{law.__name__}: deepest {-1000 * heights.min():.1f} mm")
    axes.set(xlabel="time [s]", ylabel="height in the middle of the dent [mm]")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    path = Path("out/own_deformation.png")
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path)
    print(path)


if __name__ == "__main__":
    main()
