"""A ring that a drop sends over gelatine: its crest against the shear wave speed that was measured in such gelatine.

    python examples/plots/gelatine_ring.py [--texels 192]

writes out/plots/gelatine_ring.png and prints the speeds. Nguyen et al. 2014 (Ultrasound in Medicine and Biology 40,
168) measured shear moduli of 2.01 +- 0.26, 4.18 +- 0.84 and 10.24 +- 1.80 kPa in gelatine of 3, 5 and 7 %; surface
waves much shorter than the depth run at 0.955 of the shear wave speed (Rayleigh, an incompressible half space).
"""

import argparse
from pathlib import Path

import numpy as np
from figure import COLORS, FOLDER, TEXT, plain, save, sheet
from matplotlib.axes import Axes
from standing_wave import flat_torus

from ripple_sim.solver import Material, WaveSolver

MEASURED = {"gelatine-3": (2010.0, 260.0), "gelatine-5": (4180.0, 840.0), "gelatine-7": (10240.0, 1800.0)}  # Pa
DENSITY, RAYLEIGH = 1000.0, 0.9553
SIDE, DEPTH, RADIUS = 0.4, 0.05, 0.006  # m: of the pool, its depth, of the drop


def spread(name: str, texels: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights over distance [m] and time [s] along a line from where the drop fell, [t, r]; the distances [m]."""
    atlas = flat_torus(texels, SIDE)
    waves = WaveSolver(atlas, Material.preset(name, thickness=DEPTH), backend="cpu")
    place = atlas.positions[0, texels // 2, texels // 2]
    waves.add_impulse(place, 1e-3, RADIUS)
    rows = []
    for dt in np.diff(times, prepend=0.0):
        waves.step(dt)
        rows.append(waves.height[0, texels // 2, texels // 2 :])
    return np.array(rows), SIDE / texels * np.arange(texels - texels // 2)


def front(heights: np.ndarray, distances: np.ndarray, times: np.ndarray) -> float:
    """Speed [m/s] of the first high crest or trough: a line through its places at the distances of the ring."""
    ring = np.flatnonzero((distances > 0.35 * SIDE / 2) & (distances < 0.8 * SIDE / 2))
    arrival = [times[np.abs(heights[:, each]).argmax()] for each in ring]
    return float(1 / np.polyfit(distances[ring], arrival, 1)[0])


def make(folder: Path, texels: int = 192) -> Path:
    figure = sheet(
        13.0, 4.7, "A ring on gelatine", "height over distance and time; lines: 0.955 of the measured shear speed"
    )
    for k, (name, (modulus, spread_of_it)) in enumerate(MEASURED.items()):
        speed = RAYLEIGH * np.sqrt(modulus / DENSITY)
        ends = [RAYLEIGH * np.sqrt((modulus + sign * spread_of_it) / DENSITY) for sign in (-1, 1)]
        times = np.linspace(0, SIDE / 2 / speed, 241)[1:]
        heights, distances = spread(name, texels, times)
        crest = front(heights, distances, times)
        print(f"{name}: crest {crest:.2f} m/s, measured {speed:.2f} m/s ({ends[0]:.2f} to {ends[1]:.2f})")
        axes = figure.add_axes((0.06 + 0.32 * k, 0.14, 0.27, 0.60))
        panel(axes, heights, distances, times)
        axes.plot([0, SIDE / 2], [0, SIDE / 2 / speed], color=COLORS["paper"], linewidth=1.4)
        for end in ends:
            axes.plot([0, SIDE / 2], [0, SIDE / 2 / end], color=COLORS["paper"], linewidth=0.8, linestyle="--")
        axes.set_xlim(0, SIDE / 2)
        axes.set_ylim(0, times[-1])
        axes.set_title(f"{name}: {crest:.2f} m/s, measured {speed:.2f}", fontsize=11, color=TEXT, loc="left")
    return save(figure, folder, "gelatine_ring")


def panel(axes: Axes, heights: np.ndarray, distances: np.ndarray, times: np.ndarray) -> None:
    plain(axes, "distance [m]", "time [s]")
    even = heights * np.sqrt(np.maximum(distances, distances[1]))  # rings fall as they grow
    even = even / np.maximum(np.abs(even).max(axis=1, keepdims=True), 1e-12)
    axes.pcolormesh(distances, times, even, cmap="RdBu_r", vmin=-1, vmax=1, shading="nearest", rasterized=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="A ring on gelatine against measured shear wave speeds.")
    parser.add_argument("--texels", type=int, default=192, help="along the side of the pool")
    print(make(FOLDER, parser.parse_args().texels))


if __name__ == "__main__":
    main()
