"""The draw calls of a target: into the G-buffer, with its texture, heatmap and grid, and its depth."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import MappingKind
from ripple_sim.render.visuals.assets import Assets
from ripple_sim.render.visuals.texture_mapping import Mapping

from .heatmap import HeatmapTexture
from .kept_vertices import BoundedVertices
from .surface import Surface, load_image
from .vertices import BAKED, NORMAL, mapped_coordinates


@dataclass(frozen=True)
class Paint:
    """What colours a target.

    Attributes
    ----------
    surface : Surface
    mapping : Mapping
        Of its texture.
    color : tuple of 4 floats
        Linear colour under the texture; number in the table of objects.
    transmission : float64 [3]
        Linear colour of the light that passes through it.
    """

    surface: Surface
    mapping: Mapping
    color: tuple[float, ...]
    transmission: NDArray[np.float64]


class SurfaceDrawing:
    """Programs and textures of a target.

    Parameters
    ----------
    assets : Assets
    paint : Paint
    bounded : BoundedVertices
    moved : moderngl.Buffer
        The displaced vertices.
    indices : moderngl.Buffer
        Of the triangles, int32.
    """

    def __init__(
        self, assets: Assets, paint: Paint, bounded: BoundedVertices, moved: moderngl.Buffer, indices: moderngl.Buffer
    ) -> None:
        resources, surface, mapping = assets.resources, paint.surface, paint.mapping
        heatmap, self._paint = surface.heatmap_colors is not None, paint
        options = {"MAPPING": mapping.kind, "HEATMAP": int(heatmap), "GRID": int(surface.grid > 0)}
        self._program = resources.program("surfaces/surface_vertex", "surfaces/surface_fragment", **options)
        depth = resources.program("surfaces/surface_depth_vertex", "glsl/depth_fragment")
        vertices, attributes = bounded.vertices, bounded.vertices.attributes
        mapped = mapped_coordinates(attributes, mapping)
        self._normals = resources.buffer(attributes[:, NORMAL].astype("f4").tobytes())
        self._baked = resources.buffer(attributes[:, BAKED].astype("f4").tobytes())
        still = resources.buffer(np.concatenate([vertices.places, mapped], axis=1).astype("f4").tobytes())
        content = [
            (moved, "4f", "in_moved"),
            (self._normals, "3f", "in_normal"),
            (self._baked, "3f", "in_baked"),
            (still, "2f 3f", "in_place", "in_mapped"),
        ]
        # what a program does not use is optimised away
        self._solid = resources.vertex_array(self._program, content, indices, skip_errors=True)
        # whoever looks from afar, or for shapes alone, need not see every wave split in its triangles
        whole, coarse = (resources.buffer(each.astype("i4").tobytes()) for each in (vertices.F, bounded.coarse))
        self._depth = resources.vertex_array(depth, content[:1], whole)
        albedo = resources.program("surfaces/surface_depth_vertex", "glsl/albedo_fragment")
        albedo["color"] = tuple(paint.color[:3] - paint.transmission)
        self._albedo = resources.vertex_array(albedo, content[:1], coarse)
        transmission = resources.program(
            "surfaces/surface_depth_vertex", "passes/transmission_fragment", SOLID=int(not surface.open), REFRACTING=1
        )
        transmission["transmission"] = tuple(paint.transmission)
        self._transmission = resources.vertex_array(transmission, content[:1], indices)
        self._image: moderngl.Texture | moderngl.TextureCube | None = None
        if mapping.kind != MappingKind.NO_IMAGE:
            modelled = mapping.texture >= 0
            self._image = assets.textures.get(mapping.texture) if modelled else load_image(resources, surface)
        self._heatmap: HeatmapTexture | None = None
        if surface.heatmap_colors is not None:
            self._heatmap = HeatmapTexture(resources, surface.charts.page, surface.heatmap_colors)
        self._program["resolution"] = float(surface.charts.page.resolution)
        if surface.grid:
            self._program["grid_spacing"] = float(surface.grid)
        if mapping.kind not in (MappingKind.NO_IMAGE, MappingKind.CUBE_IMAGE):
            self._program["tiling"] = mapping.tiling

    @property
    def has_heatmap(self) -> bool:
        """Whether a heatmap is shown."""
        return self._heatmap is not None

    def set_heatmap(self, values: NDArray[np.float32], limit: float) -> None:
        """Replace the heatmap's values, if there is one; see `HeatmapTexture.set`."""
        if self._heatmap is not None:
            self._heatmap.set(values, limit)

    def move(self, normals: NDArray[np.float32], baked: NDArray[np.float32]) -> None:
        """Replace the vertices' normals and what is baked, [n, 3] each."""
        self._normals.write(normals)
        self._baked.write(baked)

    def draw(self, rotation: NDArray[np.float64], count: int | moderngl.Buffer) -> None:
        """Draw the first `count` indices into the G-buffer; normals are turned by the rotation, [3, 3].

        The count is a number, or an indirect draw call's buffer.
        """
        if self._image is not None:
            self._image.use(self._paint.mapping.unit)
        if self._heatmap is not None:
            self._heatmap.use(self._program)
        self._program["rotation"] = tuple(rotation.T.ravel())
        self._program["color"] = self._paint.color
        _render(self._solid, count)

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth of the unsplit triangles, under a matrix of 16 numbers, column by column."""
        self._depth.program["matrix"] = view_projection
        self._depth.render()

    def draw_albedo(self, view_projection: tuple[float, ...]) -> None:
        """Draw few triangles of the same shape in their linear colour, likewise."""
        self._albedo.program["matrix"] = view_projection
        self._albedo.render()

    def draw_transmission(self, view_projection: tuple[float, ...], light: int, count: int | moderngl.Buffer) -> None:
        """Draw the first `count` indices into the transmission map of a light, likewise."""
        program = self._transmission.program
        program["matrix"], program["light"] = view_projection, light
        _render(self._transmission, count)


def _render(triangles: moderngl.VertexArray, count: int | moderngl.Buffer) -> None:
    if isinstance(count, moderngl.Buffer):
        triangles.render_indirect(count, count=1)
    else:
        triangles.render(vertices=count)
