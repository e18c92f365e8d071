"""Images of the charts themselves: a cube's unfolded and on the sphere, any layout's as squares side by side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.layouts.cube.convention import cube_chart_points

from .atlas_view import AtlasPainter
from .view import OVERSAMPLING, View, antialiased, lit, screen

# The belt of four charts from left to right, the second in the middle of the cross, and those above and below it.
BELT, ABOVE, BELOW = (1, 3, 0, 2), 4, 5
_GAP = 0.12  # between squares, of their side


def sphere_image(painter: AtlasPainter, resolution: int, view: View, size: int) -> NDArray[np.float64]:
    """RGBA image [size, size, 4] of the unit sphere that the cube layout maps a mesh onto."""
    x, y = screen(size * OVERSAMPLING, 1.01)
    seen = np.flatnonzero((x**2 + y**2).ravel() < 1)
    local = np.stack([x.ravel()[seen], y.ravel()[seen]], axis=1)
    local = np.column_stack([local, np.sqrt(1 - (local**2).sum(axis=1))])
    directions = local @ view.axes
    colors = painter.grid(*cube_chart_points(directions, resolution), on_surface=False)
    return antialiased(x.shape, seen, lit(colors, directions, np.ones(len(seen)), view))


def cross(painter: AtlasPainter, resolution: int, size: int) -> NDArray[np.float64]:
    """RGBA image [3 size, 4 size, 4] of a cube's charts unfolded: the belt, and a chart above and below it."""
    image = np.zeros((3 * size, 4 * size, 4))
    for chart, i, k in [(chart, 1, k) for k, chart in enumerate(BELT)] + [(ABOVE, 0, 1), (BELOW, 2, 1)]:
        image[i * size : (i + 1) * size, k * size : (k + 1) * size] = _square(painter, chart, resolution, size)
    return image


def squares(painter: AtlasPainter, shape: tuple[int, int, int], width: int, height: int) -> NDArray[np.float64]:
    """RGBA image, at most [height, width, 4], of all charts side by side, the first at the upper left."""
    count, n, _ = shape
    columns = max(range(1, count + 1), key=lambda k: min(width / k, height / -(-count // k)))
    rows = -(-count // columns)
    pitch = max(int(min(width / columns, height / rows)), 2)
    size = max(round(pitch * (1 - _GAP)), 1)
    image = np.zeros((rows * pitch, columns * pitch, 4))
    for chart in range(count):
        i, k = divmod(chart, columns)
        image[i * pitch : i * pitch + size, k * pitch : k * pitch + size] = _square(painter, chart, n, size)
    return image


def _square(painter: AtlasPainter, chart: int, resolution: int, size: int) -> NDArray[np.float64]:
    fine = size * OVERSAMPLING
    place = (np.arange(fine) + 0.5) / fine * resolution - 0.5
    row, column = np.meshgrid(place[::-1], place, indexing="ij")
    colors = painter.grid(np.full(row.size, chart), row.ravel(), column.ravel(), on_surface=False)
    return antialiased(row.shape, np.arange(row.size), colors)
