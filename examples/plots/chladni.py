"""Chladni's figures: sand on a vibrating square plate gathers where the plate is at rest.

python examples/plots/chladni.py
"""

import argparse
from pathlib import Path

import numpy as np
from figure import FAINT, FOLDER, TEXT, save, sheet
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.ndimage import map_coordinates

from ripple_sim.solver import Material, Mesh, build_atlas, modes

SIDE = 0.24  # [m]
STEEL = Material.plate(modulus=200e9, thickness=0.001, density=7850.0, poisson=0.3)
COLUMNS = 4
ROWS = 2
MODES = 24
# a grain hops so many sides far where the plate moves most
GRAINS = 9000
HOPS = 500
HOP = 0.03


def square_plate() -> Mesh:
    x, y = np.meshgrid(*2 * [np.linspace(0, SIDE, 17)])
    node = np.arange(17 * 17).reshape(17, 17)
    a, b, c, d = (
        each.ravel() for each in (node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1])
    )
    F = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh.from_arrays(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), F)


def raster(points: np.ndarray, shape: np.ndarray, size: int = 200) -> np.ndarray:
    """Heights on a grid of size x size places over the plate."""
    places = np.stack(
        np.meshgrid(*2 * [(np.arange(size) + 0.5) / size * SIDE], indexing="ij"), axis=-1
    )
    values = LinearNDInterpolator(points, shape)(places)
    return np.where(np.isnan(values), NearestNDInterpolator(points, shape)(places), values)


def sand(heights: np.ndarray) -> np.ndarray:
    """Where grains end, [k, 2], from 0 to 1."""
    random = np.random.default_rng(0)
    grains = random.random((GRAINS, 2))
    size = len(heights)
    for _ in range(HOPS):
        moved = np.abs(map_coordinates(heights, grains.T * size - 0.5, order=1, mode="nearest"))
        grains += HOP * moved[:, None] * random.standard_normal(grains.shape)
        grains = 1 - np.abs(1 - np.abs(grains))  # back from the edges
    return grains


def main() -> None:
    parser = argparse.ArgumentParser(description="Draw Chladni's figures of a free square plate.")
    parser.add_argument("-o", "--output", type=Path, default=FOLDER)
    options = parser.parse_args()
    atlas = build_atlas(square_plate(), 48, layout="patches")
    found = modes(atlas, STEEL, MODES, rim="free")
    hertz = found.frequencies
    # of two that have one frequency, any mixture is a mode; the others have the square's symmetry
    apart = np.diff(hertz, prepend=0.0, append=np.inf) / hertz.max() > 2e-3
    chosen = [k for k in range(2, MODES) if apart[k] and apart[k + 1]][: COLUMNS * ROWS]
    figure = sheet(
        9.6,
        5.9,
        "Chladni's figures",
        "Sand on the modes of a free steel plate, 24 cm square and 1 mm thick",
    )
    points = atlas.positions.reshape(-1, 3)[:, :2]
    for number, k in enumerate(chosen):
        row, column = divmod(number, COLUMNS)
        axes = figure.add_axes((0.03 + 0.24 * column, 0.48 - 0.42 * row, 0.22, 0.22 * 9.6 / 5.9))
        grains = sand(raster(points, found.shapes[k].ravel()))
        axes.set_facecolor("#20262f")
        axes.scatter(*grains.T, s=0.5, color="#efe3c8", linewidths=0)
        axes.set(xlim=(0, 1), ylim=(0, 1), xticks=[], yticks=[])
        axes.spines[:].set_color(FAINT)
        axes.set_xlabel(f"{hertz[k]:.0f} Hz", fontsize=10, color=TEXT, labelpad=3)
    print(save(figure, options.output, "chladni"))


if __name__ == "__main__":
    main()
