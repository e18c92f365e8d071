"""Images of an atlas, ray by ray: the mesh with the texel grid on it.

Every pixel is traced to its place on the charts, so the grid is exactly the atlas's.
"""

from __future__ import annotations

import functools

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ripple_sim.render.visuals.ambient_occlusion import Baked, bake
from ripple_sim.render.visuals.corners import corner_normals
from ripple_sim.solver import Atlas

from .view import OVERSAMPLING, View, antialiased, lit, screen

_GRID_CELLS = 39  # along the side of a square that holds all charts
_INK = np.array([0.10, 0.13, 0.20])


class AtlasPainter:
    """Paints images of one atlas.

    Parameters
    ----------
    atlas : Atlas
    colors : [C, n, n, 3]
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
        mesh = self._atlas.mesh
        corners = mesh.F[triangle]
        points = np.einsum("ki,kij->kj", weights, mesh.V[corners])
        normals = np.einsum("ki,kij->kj", weights, self._corner_normals[triangle])
        # an open surface shows its inner side too
        flat = np.cross(*np.moveaxis(self._vertices[corners[:, 1:]] - self._vertices[corners[:, :1]], 1, 0))
        inner = flat @ eye < 0
        baked = np.where(inner[:, None], self._baked.inner_visibility[corners], self._baked.visibility[corners])
        normals[inner] *= -1
        coordinates = self._atlas.chart_map.coordinates(mesh, triangle, points)
        colors = self.paint(*self._atlas.chart_map.chart_points(coordinates, self._atlas.resolution))
        return antialiased(x.shape, seen, lit(colors, normals, np.einsum("ki,ki->k", weights, baked), view))

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Colours [k, 3] of places on the charts, each [k]; override it to paint others."""
        return self.grid(chart, row, column, on_surface=True)

    def grid(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64], *, on_surface: bool
    ) -> NDArray[np.float64]:
        """Colours of places on the charts [k, 3]: the texel's, under a grid of fine lines and the charts' borders.

        The lines are equally wide on the surface, or else in the charts.
        """
        n = self._atlas.resolution
        i, j = (np.clip(np.rint(x).astype(np.int64), 0, n - 1) for x in (row, column))
        colors = self._colors[chart, i, j]
        cells = min(max(1, round(_GRID_CELLS / len(self._colors) ** 0.5)), n)
        along = np.stack([row, column]) + 0.5
        scale = cells / n * (self._widths[:, chart, i, j] if on_surface else 1.0)
        to_line = (np.abs((along * (cells / n) + 0.5) % 1 - 0.5) * (n / cells) * scale).min(axis=0)
        to_edge = (np.minimum(along, n - along) * scale).min(axis=0)
        ink = np.where(to_edge < 0.09, 0.85, np.where(to_line < 0.04, 0.42, 0.0))[:, None]
        return colors * (1 - ink) + _INK * ink

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
    def _baked(self) -> Baked:
        return bake(self._vertices, self._atlas.mesh.F, self._atlas.mesh.vertex_normals)

    @functools.cached_property
    def _widths(self) -> NDArray[np.float64]:
        """Width of rows and of columns on the surface, in units of an even spread's, [2, C, n, n]."""
        with_halo, areas = self._atlas.texels.halo_positions, self._atlas.areas
        own = with_halo[:, 1:-1, 1:-1]
        even = np.sqrt(areas.mean())

        def width(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
            sides = np.stack([np.linalg.norm(each - own, axis=-1) for each in (before, after)])
            side = np.where(np.isfinite(sides), sides, 0.0).sum(axis=0) / np.isfinite(sides).sum(axis=0).clip(1)
            return areas / np.maximum(side, 1e-6 * even)

        return (
            np.stack(
                [
                    width(with_halo[:, 1:-1, :-2], with_halo[:, 1:-1, 2:]),
                    width(with_halo[:, :-2, 1:-1], with_halo[:, 2:, 1:-1]),
                ]
            )
            / even
        )
