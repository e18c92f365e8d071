"""Wave speed against theory: standing waves on a membrane, a plate, a layer and water.

    python examples/plots/dispersion.py [--texels 96]

writes out/plots/dispersion.png and prints the errors.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from figure import COLORS, FOLDER, TEXT, plain, save, sheet
from layer_mode import lowest_square
from standing_wave import flat_torus, plane_wave

from ripple_sim.solver import Material

ACROSS = (1, 2, 3, 4, 6, 8, 10)  # waves on the side of the square
Theory = Callable[[float], float]

DEPTH = 1.3 / (2 * np.pi)  # m: the longest wave on a square of 1 m has q d = 1.3
MODULUS = 2010.0
DENSITY = 1000.0
TENSION = 0.072
GRAVITY = 9.81
CROSSOVER = np.sqrt(DENSITY * GRAVITY / TENSION)  # 1/m


def layer(q: float) -> float:
    """Exact frequency [1/s] of the lowest normal mode of a layer."""
    return float(np.sqrt(MODULUS / DENSITY * lowest_square(q * DEPTH)) / DEPTH)


def water(q: float) -> float:
    return float(np.sqrt(GRAVITY * q + TENSION / DENSITY * q**3))


def plate(q: float) -> float:
    return float(np.sqrt(1e6 * 0.01**2 / (12 * (1 - 0.3**2) * 1000.0)) * q**2)


# name: material, exact frequency of a wave number, sides of squares [m], waves on a side
CASES: dict[str, tuple[Material, Theory, tuple[float, ...], tuple[int, ...]]] = {
    "membrane": (Material.membrane(), lambda q: q, (1.0,), ACROSS),
    "plate": (Material.plate(1e6, 0.01, 1000.0), plate, (1.0,), ACROSS),
    "layer of 0.21 m": (
        Material.layer(MODULUS, 0.0, DENSITY, DEPTH),
        layer,
        (1.0,),
        (1, 2, 3, 4, 5, 6),
    ),
    "water": (
        Material.water(DENSITY, TENSION, GRAVITY, 0.0),
        water,
        (2 * np.pi / (0.3 * CROSSOVER), 2 * np.pi / (3 * CROSSOVER)),
        ACROSS,
    ),
}


def speeds(name: str, texels: int) -> np.ndarray:
    """Wave number [1/m], phase speed as measured and as theory has it [m/s], a row a wave."""
    material, theory, sides, counts = CASES[name]
    rows = []
    for side in sides:
        atlas = flat_torus(texels, side)
        for count in counts:
            q = 2 * np.pi * count / side
            rows.append((q, plane_wave(atlas, material, q)[0] / q, theory(q) / q))
    return np.array(rows)


def make(folder: Path, texels: int = 96) -> Path:
    figure = sheet(
        13.0,
        4.5,
        "Phase speed",
        f"standing waves on squares of {texels} x {texels} texels; lines are theory",
    )
    for k, name in enumerate(CASES):
        q, measured, exact = speeds(name, texels).T
        error = np.abs(measured / exact - 1).max()
        print(f"{name:16} {q.min():8.3g} to {q.max():8.3g} 1/m: largest error {error:.2%}")
        axes = figure.add_axes((0.06 + 0.242 * k, 0.15, 0.185, 0.59))
        plain(axes, "wave number [1/m]", "phase speed [m/s]" if k == 0 else "")
        finer = np.geomspace(q.min(), q.max(), 100)
        axes.plot(
            finer,
            [CASES[name][1](each) / each for each in finer],
            color=COLORS["paper"],
            linewidth=1.4,
        )
        axes.plot(q, measured, "o", color=COLORS["fem"], markersize=4.5)
        if q.max() > 20 * q.min():
            axes.set_xscale("log")
        axes.set_ylim(0.0, 1.15 * exact.max())
        axes.set_title(f"{name}: {error:.1%}", fontsize=11, color=TEXT, loc="left")
    return save(figure, folder, "dispersion")


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Phase speed of waves on four materials against theory."
    )
    parser.add_argument("--texels", type=int, default=96, help="along the side of the square")
    print(make(FOLDER, parser.parse_args().texels))


if __name__ == "__main__":
    main()
