"""Images of an atlas: of the mesh with its texel grid, of its charts, and of its sphere.

Every pixel of an image is traced to its place on the charts, so the grid is exactly the atlas's.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.corners import bake, corner_normals
from ripple_sim.solver import Atlas
from ripple_sim.solver.layouts.cube.convention import cube_chart_points
from ripple_sim.solver.mesh.queries import RayScene

# Samples along each side of a pixel.
OVERSAMPLING = 2

# Direction to the light: to the right, up, to the eye.
_LIGHT = np.array([-0.45, 0.55, 0.7]) / np.linalg.norm([-0.45, 0.55, 0.7])

# Brightness of a surface that is turned away from the light, and how much the light adds.
_SHADOW = 0.42
_LIGHT_STRENGTH = 0.68

# Share of the brightness that remains where the surroundings hide the whole sky.
_HIDDEN_BRIGHTNESS = 0.45

# Strength and sharpness (Phong's exponent) of the sheen.
_SHEEN = 0.10
_SHEEN_EXPONENT = 40

# Distance of the rays' origins from the middle of the mesh, whose radius is 1.
_EYE_DISTANCE = 4

# Half the side of an image over half the size of the mesh in it, and over the sphere's radius.
_MESH_MARGIN = 1.02
_SPHERE_MARGIN = 1.01

# Cells of the grid along the side of a square with the area of all charts.
_GRID_CELLS = 39

# Distance from a line of the grid, and from a chart's border, up to which there is ink [texels],
# and the opacities of the ink.
_LINE_REACH = 0.04
_BORDER_REACH = 0.09
_LINE_OPACITY = 0.42
_BORDER_OPACITY = 0.85

_INK = np.array([0.10, 0.13, 0.20])

# Place of each chart of a cube in the unfolded cross: row from above and column.
_CROSS = {1: (1, 0), 3: (1, 1), 0: (1, 2), 2: (1, 3), 4: (0, 1), 5: (2, 1)}

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
    """Shade colours [k, 3] under a soft light from the upper left, with a little sheen.

    `openness` [k] is the share of the sky that the surroundings leave open. The shading is weak, so
    that the colours can be read.
    """
    local = normals @ view.axes.T
    local /= np.maximum(np.linalg.norm(local, axis=1, keepdims=True), 1e-9)
    diffuse = 0.5 + 0.5 * local @ _LIGHT
    halfway = _LIGHT + np.array([0.0, 0.0, 1.0])  # between the light and the eye
    halfway /= np.linalg.norm(halfway)
    sheen = np.maximum(local @ halfway, 0) ** _SHEEN_EXPONENT
    brightness = _SHADOW + _LIGHT_STRENGTH * diffuse
    ambient = _HIDDEN_BRIGHTNESS + (1 - _HIDDEN_BRIGHTNESS) * openness
    shade = brightness * ambient
    return np.clip(colors * shade[:, None] + _SHEEN * (sheen * openness)[:, None], 0, 1)


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
    # the mean of a pixel's colours counts empty samples as black; alpha has their share already
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
        x, y = self._screen(view, size)
        right, up, eye = view.axes
        origins = x[..., None] * right + y[..., None] * up + _EYE_DISTANCE * eye
        directions = np.tile(-eye, (x.size, 1))
        triangle, _, u, v = self._scene.cast(origins.reshape(-1, 3), directions)
        seen = np.flatnonzero(triangle >= 0)
        triangle = triangle[seen]
        u = u[seen].astype(np.float64)
        v = v[seen].astype(np.float64)
        weights = np.stack([1 - u - v, u, v], axis=1)
        mesh = self._atlas.mesh
        corners = mesh.F[triangle]
        points = np.einsum("ki,kij->kj", weights, mesh.V[corners])
        coordinates = self._atlas.chart_map.coordinates(mesh, triangle, points)
        chart_points = self._atlas.chart_map.chart_points(coordinates, self._atlas.resolution)
        colors = self.paint(*chart_points)
        # an open surface shows its inner side too
        shows_inner_side = self._area_vectors(corners) @ eye < 0
        normals = np.einsum("ki,kij->kj", weights, self._corner_normals[triangle])
        normals[shows_inner_side] *= -1
        openness_at_corners = np.where(
            shows_inner_side[:, None], self._baked[corners, 2], self._baked[corners, 0]
        )
        openness = np.einsum("ki,ki->k", weights, openness_at_corners)
        return antialiased(x.shape, seen, lit(colors, normals, openness, view))

    def _screen(self, view: View, size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places to the right and up of all samples of an image that holds the whole mesh."""
        right, up, _ = view.axes
        plane = self._vertices @ np.stack([right, up], axis=1)
        middle = (plane.min(axis=0) + plane.max(axis=0)) / 2
        half_width = float(np.ptp(plane, axis=0).max()) / 2 * _MESH_MARGIN
        x, y = screen(size * OVERSAMPLING, half_width)
        return middle[0] + x, middle[1] + y

    def _area_vectors(self, corners: NDArray[np.int64]) -> NDArray[np.float64]:
        """Normals [k, 3] of triangles with vertices [k, 3], twice as long as their areas."""
        first = self._vertices[corners[:, 0]]
        second = self._vertices[corners[:, 1]]
        third = self._vertices[corners[:, 2]]
        return np.cross(second - first, third - first)

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Colours [k, 3] of points on the charts; a subclass may paint other colours."""
        return self.grid(chart, row, column, on_surface=True)

    def grid(
        self,
        chart: NDArray[np.int64],
        row: NDArray[np.float64],
        column: NDArray[np.float64],
        *,
        on_surface: bool,
    ) -> NDArray[np.float64]:
        """Colours [k, 3] of points on the charts, with fine lines between cells of texels.

        The points are a chart [k], and a row and a column [k] in units of texels. The lines and the
        borders of charts are equally wide on the surface, or else on the charts.
        """
        n = self._atlas.resolution
        i = np.clip(np.rint(row).astype(np.int64), 0, n - 1)
        j = np.clip(np.rint(column).astype(np.int64), 0, n - 1)
        colors = self._colors[chart, i, j]
        if not self._with_grid:
            return colors
        cells = min(max(1, round(_GRID_CELLS / len(self._colors) ** 0.5)), n)
        along = np.stack([row, column]) + 0.5  # from the chart's edge [texels], [2, k]
        width = self._widths[:, chart, i, j] if on_surface else 1.0
        scale = cells / n * width  # a texel is as wide as this share of a cell
        cells_to_line = np.abs((along * (cells / n) + 0.5) % 1 - 0.5)
        to_line = (cells_to_line * (n / cells) * scale).min(axis=0)
        to_border = (np.minimum(along, n - along) * scale).min(axis=0)
        line = np.where(to_line < _LINE_REACH, _LINE_OPACITY, 0.0)
        ink = np.where(to_border < _BORDER_REACH, _BORDER_OPACITY, line)[:, None]
        return colors * (1 - ink) + _INK * ink

    @functools.cached_property
    def _widths(self) -> NDArray[np.float64]:
        """Width of rows and columns at texels on the surface, over an even spread, [2, C, n, n]."""
        with_halo = self._atlas.texels.halo_positions
        areas = self._atlas.areas
        texels = with_halo[:, 1:-1, 1:-1]
        even = np.sqrt(areas.mean())

        def width(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
            """Area over the mean distance to the neighbours on both sides; a rim has one."""
            neighbours = (before, after)
            sides = np.stack([np.linalg.norm(other - texels, axis=-1) for other in neighbours])
            exists = np.isfinite(sides)
            total = np.where(exists, sides, 0.0).sum(axis=0)
            mean_side = total / exists.sum(axis=0).clip(1)
            return areas / np.maximum(mean_side, 1e-6 * even)

        rows = width(with_halo[:, 1:-1, :-2], with_halo[:, 1:-1, 2:])
        columns = width(with_halo[:, :-2, 1:-1], with_halo[:, 2:, 1:-1])
        return np.stack([rows, columns]) / even


def sphere_image(
    painter: AtlasPainter, resolution: int, view: View, size: int
) -> NDArray[np.float64]:
    """RGBA image [size, size, 4] of the unit sphere that the cube layout maps a mesh onto."""
    x, y = screen(size * OVERSAMPLING, _SPHERE_MARGIN)
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
    for chart, (row, column) in _CROSS.items():
        top = row * size
        left = column * size
        square = _square(painter, chart, resolution, size)
        image[top : top + size, left : left + size] = square
    return image


def squares(
    painter: AtlasPainter, shape: tuple[int, int, int], width: int, height: int
) -> NDArray[np.float64]:
    """RGBA image, at most [height, width, 4], of all charts side by side from the upper left."""
    count, resolution, _ = shape

    def pitch_with(columns: int) -> float:
        """Largest distance between squares [pixels]."""
        rows = math.ceil(count / columns)
        return min(width / columns, height / rows)

    columns = max(range(1, count + 1), key=pitch_with)
    rows = math.ceil(count / columns)
    pitch = max(int(pitch_with(columns)), 2)
    size = max(round(pitch * (1 - _SQUARE_GAP)), 1)
    image = np.zeros((rows * pitch, columns * pitch, 4))
    for chart in range(count):
        row, column = divmod(chart, columns)
        top = row * pitch
        left = column * pitch
        square = _square(painter, chart, resolution, size)
        image[top : top + size, left : left + size] = square
    return image


def _square(painter: AtlasPainter, chart: int, resolution: int, size: int) -> NDArray[np.float64]:
    """RGBA image [size, size, 4] of one chart, row 0 of the chart at the bottom."""
    fine = size * OVERSAMPLING
    place = (np.arange(fine) + 0.5) / fine * resolution - 0.5
    row, column = np.meshgrid(place[::-1], place, indexing="ij")
    colors = painter.grid(np.full(row.size, chart), row.ravel(), column.ravel(), on_surface=False)
    return antialiased(row.shape, np.arange(row.size), colors)
