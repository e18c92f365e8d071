"""Images of an atlas, ray by ray: the mesh and the sphere with the texel grid on them, and the six charts as a cross.

Every pixel is traced to its direction on the sphere and from there to its texel, so the grid is exactly the atlas's.
"""

from __future__ import annotations

import functools

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ripple_sim.render.surfaces.ambient_occlusion import bake
from ripple_sim.render.visuals.corners import corner_normals
from ripple_sim.solver import Atlas, sphere_atlas
from ripple_sim.solver.cube_map.convention import cube_chart_points

from .view import OVERSAMPLING, View, antialiased, lit, screen

# The belt of four charts from left to right, the second in the middle of the cross, and those above and below it.
BELT, ABOVE, BELOW = (1, 3, 0, 2), 4, 5
GRID_CELLS = 16  # along a chart
_INK = np.array([0.10, 0.13, 0.20])


def texel_stretch(atlas: Atlas) -> NDArray[np.float64]:
    """Stretch at every texel: sqrt(real area over area on the sphere), the real area scaled to 4 pi, [6, N, N]."""
    sphere = sphere_atlas(1.0, atlas.resolution).areas
    return np.sqrt((atlas.areas / atlas.areas.sum()) / (sphere / sphere.sum()))


class AtlasPainter:
    """Paints images of one atlas.

    Parameters
    ----------
    atlas : Atlas
    colors : [6, N, N, 3]
        Colour of every texel, 0 to 1.
    """

    def __init__(self, atlas: Atlas, colors: NDArray[np.float64]) -> None:
        self._atlas, self._colors = atlas, colors

    def mesh(self, view: View, size: int) -> NDArray[np.float64]:
        """RGBA image of the mesh, [size, size, 4], row 0 at the top."""
        right, up, eye = view.axes
        plane = self._vertices @ np.stack([right, up], axis=1)
        middle = (plane.min(axis=0) + plane.max(axis=0)) / 2
        x, y = screen(size * OVERSAMPLING, float(np.ptp(plane, axis=0).max()) / 2 * 1.02)
        origins = (middle[0] + x)[..., None] * right + (middle[1] + y)[..., None] * up + 4 * eye
        hit = self._scene.run(
            origins.reshape(-1, 3).astype(np.float32), np.tile(-eye, (x.size, 1)).astype(np.float32), output=1
        )
        seen = np.flatnonzero(hit["primID"] >= 0)
        triangle = hit["primID"][seen].astype(np.int64)
        u, v = hit["u"][seen].astype(np.float64), hit["v"][seen].astype(np.float64)
        weights = np.stack([1 - u - v, u, v], axis=1)
        corners = self._atlas.mesh.F[triangle]
        directions = np.einsum("ki,kij->kj", weights, self._atlas.sphere[corners])
        normals = np.einsum("ki,kij->kj", weights, self._corner_normals[triangle])
        openness = np.einsum("ki,ki->k", weights, self._openness[corners])
        return antialiased(x.shape, seen, lit(self.paint(directions), normals, openness, view))

    def sphere(self, view: View, size: int) -> NDArray[np.float64]:
        """RGBA image of the unit sphere that the mesh is mapped onto, [size, size, 4]."""
        x, y = screen(size * OVERSAMPLING, 1.01)
        seen = np.flatnonzero((x**2 + y**2).ravel() < 1)
        local = np.stack([x.ravel()[seen], y.ravel()[seen]], axis=1)
        local = np.column_stack([local, np.sqrt(1 - (local**2).sum(axis=1))])
        directions = local @ view.axes
        colors = self._grid(*cube_chart_points(directions, self._atlas.resolution))
        return antialiased(x.shape, seen, lit(colors, directions, np.ones(len(seen)), view))

    def cross(self, size: int) -> NDArray[np.float64]:
        """RGBA image of the six charts unfolded, [3 size, 4 size, 4]: the belt, and a chart above and below it."""
        n, fine = self._atlas.resolution, size * OVERSAMPLING
        place = (np.arange(fine) + 0.5) / fine * n - 0.5
        row, column = np.meshgrid(place[::-1], place, indexing="ij")
        image = np.zeros((3 * size, 4 * size, 4))
        layout = [(chart, 1, k) for k, chart in enumerate(BELT)] + [(ABOVE, 0, 1), (BELOW, 2, 1)]
        for chart, i, k in layout:
            colors = self._grid(np.full(row.size, chart), row.ravel(), column.ravel())
            image[i * size : (i + 1) * size, k * size : (k + 1) * size] = antialiased(
                row.shape, np.arange(row.size), colors
            )
        return image

    def paint(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Colours [k, 3] of the surface in directions [k, 3] from the cube's centre; override it to paint others."""
        return self._grid(*cube_chart_points(directions, self._atlas.resolution), self._widths)

    @functools.cached_property
    def _vertices(self) -> NDArray[np.float64]:
        V = self._atlas.mesh.V
        middle = (V.min(axis=0) + V.max(axis=0)) / 2
        return (V - middle) / np.linalg.norm(V - middle, axis=1).max()

    @functools.cached_property
    def _scene(self) -> EmbreeScene:
        scene = EmbreeScene()
        TriangleMesh(scene, self._vertices.astype(np.float32), self._atlas.mesh.F.astype(np.int32))
        return scene

    @functools.cached_property
    def _corner_normals(self) -> NDArray[np.float64]:
        return corner_normals(self._vertices, self._atlas.mesh.F)

    @functools.cached_property
    def _openness(self) -> NDArray[np.float64]:
        return bake(self._vertices, self._atlas.mesh.F, self._atlas.mesh.vertex_normals).visibility

    @functools.cached_property
    def _widths(self) -> NDArray[np.float64]:
        """Width of rows and of columns on the surface, in units of an even spread's, [2, 6, N, N]."""
        with_halo, areas = self._atlas.texels.halo_positions, self._atlas.areas
        along_columns = np.linalg.norm(with_halo[:, 1:-1, 2:] - with_halo[:, 1:-1, :-2], axis=-1) / 2
        along_rows = np.linalg.norm(with_halo[:, 2:, 1:-1] - with_halo[:, :-2, 1:-1], axis=-1) / 2
        even = np.sqrt(areas.mean())
        return np.stack([areas / np.maximum(side, 1e-6 * even) for side in (along_columns, along_rows)]) / even

    def _grid(
        self,
        chart: NDArray[np.int64],
        row: NDArray[np.float64],
        column: NDArray[np.float64],
        widths: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Colours of places in the charts [k, 3]: the texel's, under a grid of fine lines and the cube's edges.

        With `widths` the lines are equally wide on the surface, without it in the charts.
        """
        n = self._atlas.resolution
        i, j = (np.clip(np.rint(x).astype(np.int64), 0, n - 1) for x in (row, column))
        colors = self._colors[chart, i, j]
        cells = min(GRID_CELLS, n)
        along = np.stack([row, column]) + 0.5
        scale = cells / n * (1.0 if widths is None else widths[:, chart, i, j])
        to_line = (np.abs((along * (cells / n) + 0.5) % 1 - 0.5) * (n / cells) * scale).min(axis=0)
        to_edge = (np.minimum(along, n - along) * scale).min(axis=0)
        ink = np.where(to_edge < 0.09, 0.85, np.where(to_line < 0.04, 0.42, 0.0))[:, None]
        return colors * (1 - ink) + _INK * ink
