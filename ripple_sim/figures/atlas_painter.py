"""Images of an atlas: of the mesh with its texel grid, of its charts, and of its sphere.

Every pixel of an image is traced to its place on the charts, so the grid is exactly the atlas's.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.corners import bake, corner_normals
from ripple_sim.solver import Atlas
from ripple_sim.solver.layouts.cube.convention import cube_chart_points
from ripple_sim.solver.mesh.queries import RayScene

# samples along each side of a pixel
OVERSAMPLING = 2

# Direction to the light: to the right, up, to the eye.
_LIGHT = np.array([-0.45, 0.55, 0.7]) / np.linalg.norm([-0.45, 0.55, 0.7])

# cells of the grid along the side of a square with the area of all charts
_GRID_CELLS = 39

_INK = np.array([0.10, 0.13, 0.20])

# The belt of four charts from left to right, the second in the middle of the cross, and those above
# and below it.
BELT = (1, 3, 0, 2)
ABOVE = 4
BELOW = 5

# Gap between the squares of charts, over their side.
_SQUARE_GAP = 0.12


@dataclasses.dataclass(frozen=True)
class View:
    """An orthographic look at a surface.

    Attributes
    ----------
    azimuth, elevation : float
        Where the eye is [degrees]; azimuth 0 looks along the negative forward axis, which points
        out of the screen.
    up : str
        Axis of the mesh's file that points up: "y" or "z".
    """

    azimuth: float = 35.0
    elevation: float = 18.0
    up: str = "y"

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors to the right, up and towards the eye, as rows, shape [3, 3]."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        eye = np.array(
            [
                np.sin(azimuth) * np.cos(elevation),
                np.sin(elevation),
                np.cos(azimuth) * np.cos(elevation),
            ]
        )
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        axes = np.stack([right, np.cross(eye, right), eye])
        return axes if self.up == "y" else axes[:, [0, 2, 1]] * [1.0, -1.0, 1.0]


def lit(
    colors: NDArray[np.float64],
    normals: NDArray[np.float64],
    openness: NDArray[np.float64],
    view: View,
) -> NDArray[np.float64]:
    """Shade colours under a soft light from the upper left, with a little sheen.

    The shading is weak, so that the colours can be read.
    """
    local = normals @ view.axes.T
    local /= np.maximum(np.linalg.norm(local, axis=1, keepdims=True), 1e-9)
    diffuse = 0.5 + 0.5 * local @ _LIGHT
    half = _LIGHT + np.array([0.0, 0.0, 1.0])
    sheen = np.maximum(local @ (half / np.linalg.norm(half)), 0) ** 40
    shade = (0.42 + 0.68 * diffuse) * (0.45 + 0.55 * openness)
    return np.clip(colors * shade[:, None] + 0.10 * (sheen * openness)[:, None], 0, 1)


def screen(size: int, half_width: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places x and y of the pixels of a square from -half_width to half_width, row 0 at the top."""
    place = ((np.arange(size) + 0.5) / size * 2 - 1) * half_width
    y, x = np.meshgrid(place[::-1], place, indexing="ij")
    return x, y


def antialiased(
    shape: tuple[int, ...], seen: NDArray[np.int64], colors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """RGBA image, averaged over the oversampling, of colours [k, 3] at the pixels `seen`."""
    fine = np.zeros((shape[0] * shape[1], 4))
    fine[seen, :3] = colors
    fine[seen, 3] = 1.0
    k = OVERSAMPLING
    coarse = fine.reshape(shape[0] // k, k, shape[1] // k, k, 4).mean(axis=(1, 3))
    # colours are summed where something is seen only: undo the dilution, which alpha already
    # expresses
    coarse[..., :3] /= np.maximum(coarse[..., 3:], 1e-9)
    return np.clip(coarse, 0, 1)


class AtlasPainter:
    """Paints images of one atlas.

    Parameters
    ----------
    atlas : Atlas
    colors : [C, n, n, 3]
        Colour of every texel, 0 to 1.
    with_grid : bool
        Whether the texel grid is drawn on the mesh.
    """

    def __init__(
        self, atlas: Atlas, colors: NDArray[np.float64], *, with_grid: bool = True
    ) -> None:
        self._atlas = atlas
        self._colors = colors
        self._with_grid = with_grid
        V = atlas.mesh.V
        F = atlas.mesh.F
        middle = (V.min(axis=0) + V.max(axis=0)) / 2
        self._vertices = (V - middle) / np.linalg.norm(V - middle, axis=1).max()
        self._scene = RayScene(self._vertices, F)
        self._corner_normals = corner_normals(self._vertices, F)
        self._baked = bake(self._vertices, F, atlas.mesh.vertex_normals)

    def mesh(self, view: View, size: int) -> NDArray[np.float64]:
        """RGBA image of the mesh, [size, size, 4], row 0 at the top."""
        right, up, eye = view.axes
        plane = self._vertices @ np.stack([right, up], axis=1)
        middle = (plane.min(axis=0) + plane.max(axis=0)) / 2
        x, y = screen(size * OVERSAMPLING, float(np.ptp(plane, axis=0).max()) / 2 * 1.02)
        origins = (middle[0] + x)[..., None] * right + (middle[1] + y)[..., None] * up + 4 * eye
        triangle, _, *inside = self._scene.cast(origins.reshape(-1, 3), np.tile(-eye, (x.size, 1)))
        seen = np.flatnonzero(triangle >= 0)
        triangle = triangle[seen]
        (u, v) = (each[seen].astype(np.float64) for each in inside)
        weights = np.stack([1 - u - v, u, v], axis=1)
        mesh = self._atlas.mesh
        corners = mesh.F[triangle]
        points = np.einsum("ki,kij->kj", weights, mesh.V[corners])
        normals = np.einsum("ki,kij->kj", weights, self._corner_normals[triangle])
        # an open surface shows its inner side too
        flat = np.cross(
            *np.moveaxis(self._vertices[corners[:, 1:]] - self._vertices[corners[:, :1]], 1, 0)
        )
        inner = flat @ eye < 0
        baked = np.where(inner[:, None], self._baked[corners, 2], self._baked[corners, 0])
        normals[inner] *= -1
        coordinates = self._atlas.chart_map.coordinates(mesh, triangle, points)
        colors = self.paint(
            *self._atlas.chart_map.chart_points(coordinates, self._atlas.resolution)
        )
        return antialiased(
            x.shape, seen, lit(colors, normals, np.einsum("ki,ki->k", weights, baked), view)
        )

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Colours [k, 3] of places on the charts, each [k]; override it to paint others."""
        return self.grid(chart, row, column, on_surface=True)

    def grid(
        self,
        chart: NDArray[np.int64],
        row: NDArray[np.float64],
        column: NDArray[np.float64],
        *,
        on_surface: bool,
    ) -> NDArray[np.float64]:
        """Colours of points on the charts [k, 3].

        They are the colours of the texels, under a grid of fine lines and the borders of the
        charts.

        The lines are equally wide on the surface, or else in the charts.
        """
        n = self._atlas.resolution
        i, j = (np.clip(np.rint(x).astype(np.int64), 0, n - 1) for x in (row, column))
        colors = self._colors[chart, i, j]
        if not self._with_grid:
            return colors
        cells = min(max(1, round(_GRID_CELLS / len(self._colors) ** 0.5)), n)
        along = np.stack([row, column]) + 0.5
        scale = cells / n * (self._widths[:, chart, i, j] if on_surface else 1.0)
        to_line = (np.abs((along * (cells / n) + 0.5) % 1 - 0.5) * (n / cells) * scale).min(axis=0)
        to_edge = (np.minimum(along, n - along) * scale).min(axis=0)
        ink = np.where(to_edge < 0.09, 0.85, np.where(to_line < 0.04, 0.42, 0.0))[:, None]
        return colors * (1 - ink) + _INK * ink

    @functools.cached_property
    def _widths(self) -> NDArray[np.float64]:
        """Width of rows and columns on the surface, relative to an even spread, [2, C, n, n]."""
        with_halo = self._atlas.texels.halo_positions
        areas = self._atlas.areas
        own = with_halo[:, 1:-1, 1:-1]
        even = np.sqrt(areas.mean())

        def width(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
            sides = np.stack([np.linalg.norm(each - own, axis=-1) for each in (before, after)])
            side = np.where(np.isfinite(sides), sides, 0.0).sum(axis=0) / np.isfinite(sides).sum(
                axis=0
            ).clip(1)
            return areas / np.maximum(side, 1e-6 * even)

        rows = width(with_halo[:, 1:-1, :-2], with_halo[:, 1:-1, 2:])
        columns = width(with_halo[:, :-2, 1:-1], with_halo[:, 2:, 1:-1])
        return np.stack([rows, columns]) / even


def sphere_image(
    painter: AtlasPainter, resolution: int, view: View, size: int
) -> NDArray[np.float64]:
    """RGBA image [size, size, 4] of the unit sphere that the cube layout maps a mesh onto."""
    x, y = screen(size * OVERSAMPLING, 1.01)
    seen = np.flatnonzero((x**2 + y**2).ravel() < 1)
    local = np.stack([x.ravel()[seen], y.ravel()[seen]], axis=1)
    local = np.column_stack([local, np.sqrt(1 - (local**2).sum(axis=1))])
    directions = local @ view.axes
    colors = painter.grid(*cube_chart_points(directions, resolution), on_surface=False)
    return antialiased(x.shape, seen, lit(colors, directions, np.ones(len(seen)), view))


def cross(painter: AtlasPainter, resolution: int, size: int) -> NDArray[np.float64]:
    """RGBA image [3 size, 4 size, 4] of a cube's six charts, unfolded.

    Four charts are in the middle row, with one above and one below.
    """
    image = np.zeros((3 * size, 4 * size, 4))
    for chart, i, k in [(chart, 1, k) for k, chart in enumerate(BELT)] + [
        (ABOVE, 0, 1),
        (BELOW, 2, 1),
    ]:
        image[i * size : (i + 1) * size, k * size : (k + 1) * size] = _square(
            painter, chart, resolution, size
        )
    return image


def squares(
    painter: AtlasPainter, shape: tuple[int, int, int], width: int, height: int
) -> NDArray[np.float64]:
    """RGBA image, at most [height, width, 4], of all charts side by side from the upper left."""
    count, n, _ = shape
    columns = max(range(1, count + 1), key=lambda k: min(width / k, height / -(-count // k)))
    rows = -(-count // columns)
    pitch = max(int(min(width / columns, height / rows)), 2)
    size = max(round(pitch * (1 - _SQUARE_GAP)), 1)
    image = np.zeros((rows * pitch, columns * pitch, 4))
    for chart in range(count):
        i, k = divmod(chart, columns)
        image[i * pitch : i * pitch + size, k * pitch : k * pitch + size] = _square(
            painter, chart, n, size
        )
    return image


def _square(painter: AtlasPainter, chart: int, resolution: int, size: int) -> NDArray[np.float64]:
    fine = size * OVERSAMPLING
    place = (np.arange(fine) + 0.5) / fine * resolution - 0.5
    row, column = np.meshgrid(place[::-1], place, indexing="ij")
    colors = painter.grid(np.full(row.size, chart), row.ravel(), column.ravel(), on_surface=False)
    return antialiased(row.shape, np.arange(row.size), colors)
