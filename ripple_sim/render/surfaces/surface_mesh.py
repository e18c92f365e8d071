"""A target on the GPU: a mesh that its height map displaces."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import Balls, balls_about
from ripple_sim.render.visuals.assets import Assets
from ripple_sim.solver.errors import RippleError

from .adaptive_tessellation import AdaptiveTessellation
from .charts import Charts
from .displacement import Displacement, Place
from .height_maps import HeightMapTextures
from .surface import Surface, appearance
from .surface_drawing import Paint, SurfaceDrawing
from .vertices import POSITION, SurfaceVertices, surface_vertices

_PIXELS = 4.0  # length of an edge where the target fills the frame's height
_PIXELS_PER_FACE = 48  # of the frame
_TOLERANCE = 0.15  # [pixels], likewise: edges from which the waves depart further are split
_BALLS = 16  # that bound the mesh
_NO_SHADOW = 0.75  # transparency from which a target casts no shadow
_HIGHEST_BIAS = 0.05  # of shadows, in radii


class SurfaceMesh:
    """A target on the GPU: triangles of a few pixels, so that it is round in outline and displaces smoothly.

    Where waves are sharp, a frame has up to four triangles in place of one. An open surface shows both of its sides.

    Parameters
    ----------
    assets : Assets
    geom : int
        The target's geom.
    surface : Surface
    height_maps : HeightMapTextures
        Of all targets.
    index : int
        Of the target among them.
    size : (width, height)
        Of the frame [pixels].

    Attributes
    ----------
    number : int
        In the table of objects.
    transparent, casts_shadow : bool
    """

    def __init__(
        self,
        assets: Assets,
        geom: int,
        surface: Surface,
        height_maps: HeightMapTextures,
        index: int,
        size: tuple[int, int],
    ) -> None:
        self.geom, self._charts, self._open, self._gl = geom, surface.charts, surface.open, assets.resources.gl
        self._objects, self._height_maps, self._layer = assets.objects, height_maps, index
        self._radius = float(np.linalg.norm(surface.V, axis=1).max())
        look, rgb, mapping = appearance(assets.model, geom, surface)
        self.transparent = look.transparency > 0.0
        self.casts_shadow = look.transparency < _NO_SHADOW
        self.number = assets.objects.add(
            look,
            geom,
            size=self._radius,
            heatmap=surface.heatmap_colors is not None,
            height_map=index,
        )
        pixel = 2 * self._radius / size[1]
        vertices = surface_vertices(surface, pixel * _PIXELS, size[0] * size[1] // _PIXELS_PER_FACE)
        middle = len(vertices.attributes) - len(vertices.edges.ends) + vertices.edges.of_side
        corners = np.concatenate([vertices.F, middle])
        self._balls = balls_about(vertices.attributes[:, POSITION][corners], _BALLS)
        self._tessellation = _adaptive(vertices, surface.charts, pixel)
        self._triangles: NDArray[np.int32] | None = None  # on the GPU
        self._displacement = Displacement(assets.resources, vertices, geom=geom, layer=index)
        self._indices = assets.resources.buffer(reserve=4 * 12 * len(vertices.F), dynamic=True)
        paint = Paint(surface, mapping, (*rgb, float(self.number)))
        self._drawing = SurfaceDrawing(assets, paint, vertices, self._displacement.moved, self._indices)

    def update(self, ctx: moderngl.Context, place: Place, height_map: NDArray[np.float32] | None) -> None:
        """Displace the vertices by a height map [C, n + 2, n + 2, 4] (none: flat) where the geom is.

        Raises
        ------
        RippleError
            If the height map has another shape.
        """
        shape = (*self._charts.halo_shape, 4)
        if height_map is None:
            height_map = np.zeros(shape, dtype=np.float32)
        if height_map.shape != shape:
            raise RippleError(
                f"the height map of geom {self.geom} has shape {list(height_map.shape)}; valid is {list(shape)}: "
                "charts with a halo of one texel, gradient and height"
            )
        self._pose, self._highest = (place.rotation, place.origin), float(np.abs(height_map[..., 3]).max())
        bias = min(1.5 * self._highest, _HIGHEST_BIAS * self._radius)
        self._objects.set_height_map(self.number, bias, place.rotation)
        triangles, midpoints = self._tessellation(height_map)
        if triangles is not self._triangles:
            self._indices.write(triangles)
            self._triangles = triangles
        self._index_count = triangles.size
        self._height_maps.write(self._layer, height_map)
        self._height_maps.bind()
        self._displacement.run(ctx, place, midpoints)

    def set_heatmap(self, values: NDArray[np.float32], limit: float) -> None:
        """Replace the heatmap's values, [C, n + 2, n + 2] with a halo; the colours range from -limit to limit.

        Raises
        ------
        RippleError
            If the surface has no heatmap, the shape is another, or the limit is not a positive, finite number.
        """
        if not self._drawing.has_heatmap:
            raise RippleError(f"geom {self.geom} has no heatmap; give its `Surface` heatmap_colors")
        self._drawing.set_heatmap(values, limit)

    def ball(self) -> Balls:
        """Ball about the geom's origin that contains the displaced mesh; it stays the same as the geom turns."""
        return Balls(self._pose[1][None], np.array([self._radius + self._highest]))

    def balls(self) -> Balls:
        """Balls that together contain the displaced mesh."""
        centres, radii = self._balls
        return Balls(centres @ self._pose[0].T + self._pose[1], radii + self._highest)

    def draw(self) -> None:
        """Draw into the G-buffer."""
        with self._sides():
            self._drawing.draw(self._pose[0], self._index_count)

    def draw_shadow(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth of the sides that are shown, as `draw_depth` does without culling."""
        with self._sides():
            self.draw_depth(view_projection)

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth only, under a matrix of 16 numbers, column by column."""
        self._drawing.draw_depth(view_projection, self._index_count)

    @contextlib.contextmanager
    def _sides(self) -> Iterator[None]:
        """Where back faces are culled: cull none of an open surface."""
        with self._gl as ctx:
            if self._open:
                ctx.disable(moderngl.CULL_FACE)
            yield
            if self._open:
                ctx.enable(moderngl.CULL_FACE)


def _adaptive(vertices: SurfaceVertices, charts: Charts, pixel: float) -> AdaptiveTessellation:
    return AdaptiveTessellation(
        vertices.F,
        vertices.edges,
        vertices.attributes[:, POSITION],
        vertices.lookups,
        charts.page,
        tolerance=_TOLERANCE * pixel,
        min_length=1.5 * _PIXELS * pixel,
    )
