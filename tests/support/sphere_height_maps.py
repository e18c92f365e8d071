"""Height maps of a sphere, by functions of the unit vector."""

import numpy as np

from ripple_sim.render.surfaces import Charts
from ripple_sim.solver.layouts.cube import CubeChartMap, cube_topology, texel_directions
from ripple_sim.solver.texels import ChartPage

N = 24


def cube_charts(sphere: np.ndarray, resolution: int = N) -> Charts:
    """Charts of a surface by its sphere map, one unit vector a vertex."""
    return Charts(CubeChartMap(sphere), ChartPage(6, resolution))


def height_map_of(height, gradient) -> np.ndarray:
    """Height map of functions of the unit vector, with its halo."""
    directions = texel_directions(N)
    texels = np.concatenate([gradient(directions), height(directions)[..., None]], axis=3)
    index = cube_topology(N).halo
    with_halo = texels.reshape(-1, 4)[np.maximum(index, 0)]
    for row in (0, -1):
        for column in (0, -1):
            r = 1 if row == 0 else -2
            c = 1 if column == 0 else -2
            with_halo[:, row, column] = (
                with_halo[:, r, c] + with_halo[:, r, column] + with_halo[:, row, c]
            ) / 3
    return with_halo.astype(np.float32)


def constant_height_map(height: float) -> np.ndarray:
    return height_map_of(lambda d: np.full(d.shape[:3], height), np.zeros_like)


def linear_height_map(slope: np.ndarray) -> np.ndarray:
    """Height `slope . d` on the unit sphere: smooth everywhere, cube edges and corners included."""
    return height_map_of(lambda d: d @ slope, lambda d: slope - (d @ slope)[..., None] * d)
