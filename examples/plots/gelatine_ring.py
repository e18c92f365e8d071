"""The ring of a drop on gelatine: the leading crest against the exact waves.

    python examples/plots/gelatine_ring.py [--texels 192]

writes out/plots/gelatine_ring.png and prints the speeds. Nguyen et al. 2014 (Ultrasound in Medicine
and Biology 40,
168) measured shear moduli of 2.01 +- 0.26, 4.18 +- 0.84 and 10.24 +- 1.80 kPa in gelatine of 3, 5
  and 7 %; surface waves much shorter than the depth run at 0.955 of the shear wave speed (Rayleigh,
  an incompressible half space).
"""

import argparse
import functools
from pathlib import Path

import numpy as np
from figure import COLORS, FOLDER, TEXT, plain, save, sheet
from layer_mode import lowest_square, moving_mass
from matplotlib.axes import Axes
from scipy.special import j0, jv
from standing_wave import flat_torus

from ripple_sim.solver import Material, WaveSolver

# Pa
MEASURED = {
    "gelatine-3": (2010.0, 260.0),
    "gelatine-5": (4180.0, 840.0),
    "gelatine-7": (10240.0, 1800.0),
}
VISCOSITY = 0.6
DENSITY = 1000.0
RAYLEIGH = 0.9553
# m: of the pool, its depth, of the drop; N s
SIDE = 0.4
DEPTH = 0.05
RADIUS = 0.006
IMPULSE = 1e-3


def spread(name: str, texels: int, times: np.ndarray, short: bool) -> np.ndarray:
    """Heights over time [s] and distance from the drop, along a line [t, r]."""
    atlas = flat_torus(texels, SIDE)
    waves = WaveSolver(atlas, Material.preset(name, thickness=DEPTH, short=short), backend="cpu")
    place = atlas.positions[0, texels // 2, texels // 2]
    waves.add_impulse(place, IMPULSE, RADIUS)
    rows = []
    for dt in np.diff(times, prepend=0.0):
        waves.step(dt)
        rows.append(waves.height[0, texels // 2, texels // 2 :])
    return np.array(rows)


@functools.cache
def modes() -> np.ndarray:
    """The exact mode: wave numbers [1/depth], squared frequencies, masses and widths, [4, k]."""
    q = np.concatenate([np.linspace(1.0, 8.0, 71), np.linspace(8.3, 40.0, 100)])
    return np.array(
        [q, [lowest_square(each) for each in q], [moving_mass(each) for each in q], np.gradient(q)]
    )


def exact_ring(modulus: float, distances: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The heights [t, r] on an endless layer in its lowest mode: a sum of round waves."""
    q, square, mass, width = modes()
    square = square * modulus / DENSITY / DEPTH**2
    across = q * RADIUS / DEPTH
    load = 384 * jv(4, across) / across**4  # of a footprint (1 - (d / r)^2)^3
    rate = square * VISCOSITY / modulus / 2
    swing = np.sqrt(square - rate**2)
    parts = -IMPULSE * load * q * width / (2 * np.pi * DENSITY * DEPTH**3 * mass * swing)
    swings = np.sin(np.outer(times, swing)) * np.exp(-np.outer(times, rate))
    return (swings * parts) @ j0(np.outer(q, distances / DEPTH))


def leading_crest(
    heights: np.ndarray, distances: np.ndarray, times: np.ndarray, speed: float
) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] of the leading crest and distances [m] of the ring, [k].

    It is the greatest height on the side to which the drop pressed, of what runs with 0.84 to 1.1
    of a speed [m/s]: farther out some of what follows is higher, and long low waves run ahead.
    """
    ring = distances[(distances > 0.35 * SIDE / 2) & (distances < 0.8 * SIDE / 2)]
    pressed = -heights[:, np.isin(distances, ring)]
    near = np.abs(np.log(ring / (times[:, None] * speed) / 0.96)) < 0.135
    return times[np.where(near, pressed, -np.inf).argmax(axis=0)], ring


def make(folder: Path, texels: int = 192) -> Path:
    figure = sheet(
        13.0,
        4.7,
        "A ring on gelatine",
        "height over distance and time; lines: 0.955 of the measured shear speed",
    )
    for k, (name, (modulus, spread_of_it)) in enumerate(MEASURED.items()):
        speed = RAYLEIGH * np.sqrt(modulus / DENSITY)
        ends = [RAYLEIGH * np.sqrt((modulus + sign * spread_of_it) / DENSITY) for sign in (-1, 1)]
        times = np.linspace(0, SIDE / 2 / speed, 301)[1:]
        distances = SIDE / texels * np.arange(texels - texels // 2)
        exact = exact_ring(modulus, distances, times)
        due, ring = leading_crest(exact, distances, times, speed)
        print(f"{name}: measured {speed:.2f} m/s ({ends[0]:.2f} to {ends[1]:.2f})")
        print(f"  exact mode:  crest {1 / np.polyfit(ring, due, 1)[0]:.2f} m/s")
        for short in (False, True):
            heights = spread(name, texels, times, short)
            arrival = leading_crest(heights, distances, times, speed)[0]
            late = arrival / due - 1
            crest = 1 / np.polyfit(ring, arrival, 1)[0]
            both = [each[:, np.isin(distances, ring)] for each in (heights, exact)]
            like = np.corrcoef(both[0].ravel(), both[1].ravel())[0, 1]
            high = np.divide(*np.abs(both).max(axis=1))
            print(
                f"  short={short!s:5}: crest {crest:.2f} m/s, late by {late.min():.1%} to "
                f"{late.max():.1%} of the "
                f"time; all waves {high.min():.2f} to {high.max():.2f} as high, correlation "
                f"{like:.2f}"
            )
        axes = figure.add_axes((0.06 + 0.32 * k, 0.14, 0.27, 0.60))
        panel(axes, heights, distances, times)
        axes.plot([0, SIDE / 2], [0, SIDE / 2 / speed], color=COLORS["paper"], linewidth=1.4)
        for end in ends:
            axes.plot(
                [0, SIDE / 2],
                [0, SIDE / 2 / end],
                color=COLORS["paper"],
                linewidth=0.8,
                linestyle="--",
            )
        axes.set_xlim(0, SIDE / 2)
        axes.set_ylim(0, times[-1])
        axes.set_title(
            f"{name}: {crest:.2f} m/s, measured {speed:.2f}", fontsize=11, color=TEXT, loc="left"
        )
    return save(figure, folder, "gelatine_ring")


def panel(axes: Axes, heights: np.ndarray, distances: np.ndarray, times: np.ndarray) -> None:
    plain(axes, "distance [m]", "time [s]")
    even = heights * np.sqrt(np.maximum(distances, distances[1]))  # rings fall as they grow
    even = even / np.maximum(np.abs(even).max(axis=1, keepdims=True), 1e-12)
    axes.pcolormesh(
        distances, times, even, cmap="RdBu_r", vmin=-1, vmax=1, shading="nearest", rasterized=True
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description="A ring on gelatine against measured shear wave speeds."
    )
    parser.add_argument("--texels", type=int, default=192, help="along the side of the pool")
    print(make(FOLDER, parser.parse_args().texels))


if __name__ == "__main__":
    main()
