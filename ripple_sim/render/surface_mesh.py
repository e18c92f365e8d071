"""A rippling surface on the GPU."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import is_soft
from ripple_sim.render.surfaces.adaptive import (
    AdaptiveTessellation,
    DeviceTessellation,
    Displacement,
)
from ripple_sim.render.surfaces.moving import MovingOcclusion, MovingVertices
from ripple_sim.render.surfaces.surface import HeatmapTexture, Surface, appearance
from ripple_sim.render.surfaces.tessellation import BAKED, DIRECTION, NORMAL, POSITION
from ripple_sim.render.surfaces.vertices import mapped_coordinates, surface_vertices
from ripple_sim.render.visuals.objects import Assets, Occluders
from ripple_sim.render.visuals.visual import Visual, geom_visual
from ripple_sim.solver.errors import RippleError

from .bounds import balls_about
from .contract import CasterMap, MappingKind
from .height_map_textures import AnyHeightMap, HeightMapTextures, MovedHeightMap

_PIXELS = 5.6  # length of an edge where the target fills the frame's height


_TOLERANCE = 0.25  # [pixels], likewise: edges from which the waves depart further are split


_PIXELS_PER_FACE = 192  # of the frame: fewer than about eight pixels each cost more than they show


_BALLS = 16  # that bound a mesh that moves


_HIGHEST_BIAS = 0.015  # of shadows, in radii


class SurfaceMesh:
    """A target on the GPU: triangles of a few pixels, so that it is round in outline and displaces smoothly.

    Where waves are sharp, a frame has up to four triangles in place of one. An open surface shows
    both of its sides.

    Parameters
    ----------
    geom : int
        The target's geom.
    height_maps : HeightMapTextures
        Of all targets.
    index : int
        Of the target among them.
    size : (width, height)
        Of the frame [pixels].

    Attributes
    ----------
    numbers : list of int
        Its one number in the table of objects.
    transparent, blocks, occludes, casts : bool
        Whether the scene behind shows through, and whether no light passes; whether it hides the
        sky from what is below, and casts shadows, as every target does.
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
        resources = assets.resources
        page = surface.charts.page
        self.geom = geom
        self._open = surface.open
        self._gl = resources.gl
        self._resources = resources
        self._assets = assets
        self._objects = assets.objects
        self._height_maps = height_maps
        self._layer = index
        self._page = page
        self._shape = (page.charts, page.block, page.block, 4)
        self._middle = np.zeros(3)  # of what is soft its own, of a geom that of its frame
        if is_soft(assets.model, geom):
            self._middle = (surface.V.min(axis=0) + surface.V.max(axis=0)) / 2
        self._radius = self._reach = float(np.linalg.norm(surface.V - self._middle, axis=1).max())
        visual = geom_visual(assets.model, geom)
        look, _, mapping = appearance(assets.model, visual, surface)
        self.occludes = True
        self.casts = True
        self.is_plane = False
        heatmap = surface.heatmap_colors is not None
        number = assets.objects.add(
            look,
            geom,
            identity=visual.identity,
            size=self._radius,
            heatmap=heatmap,
            height_map=index,
            chart=page.block,
        )
        self.numbers = [number]
        pixel = 2 * self._radius / size[1]
        self._vertices = vertices = surface_vertices(
            surface, pixel * _PIXELS, size[0] * size[1] // _PIXELS_PER_FACE
        )
        self._balls = vertices.balls
        self._adaptive = AdaptiveTessellation(
            vertices, page, _TOLERANCE * pixel, min_length=1.5 * _PIXELS * pixel
        )
        self._indices = resources.buffer(reserve=4 * 12 * len(vertices.F), dynamic=True)
        self._written: NDArray[np.int32] | None = None  # the triangles that the buffer holds
        self._on_device: DeviceTessellation | None = None
        self._count: int | moderngl.Buffer
        mapped = mapped_coordinates(vertices.attributes, mapping)
        self._displacement = displacement = Displacement(resources, vertices, mapped, index)
        self._mesh = surface.moving or (surface.V, surface.F)
        self._moving: tuple[MovingVertices, MovingOcclusion] | None = None

        colors = surface.heatmap_colors
        self._heatmap = None if colors is None else HeatmapTexture(resources, page, colors)
        self._programs: dict[MappingKind, tuple[moderngl.Program, moderngl.VertexArray]] = {}
        moved = (displacement.moved, "4f", "in_moved")
        # whoever looks from afar, or for shapes alone, need not see every wave split in its
        # triangles
        whole, coarse = (
            resources.buffer(each.astype("i4").tobytes()) for each in (vertices.F, vertices.coarse)
        )
        lens = int(not self._open and look.transparency > 0.0)
        self._casters = {
            seen: resources.vertex_array(
                resources.program("passes/casters", MOVED=1, MAP=seen, SOLID=lens),
                [moved],
                triangles,
            )
            for seen, triangles in zip(CasterMap, (whole, coarse, self._indices), strict=True)
        }
        self._surface = surface
        self._mapping = mapping
        self.paint(visual)

    def paint(self, visual: Visual) -> None:
        """Be painted as what it stands for."""
        look, rgb, mapping = appearance(self._assets.model, visual, self._surface)
        opacity = visual.opacity or 1.0  # what MuJoCo shows nothing of is drawn all the same
        self._objects.paint(self.numbers[0], look, opacity)
        self.transparent = look.transparency > 0.0 or opacity < 1.0
        self.blocks = not self.transparent
        self._color = (*rgb, float(self.numbers[0]))
        # linear colour of the light that passes
        passing = 1.0 - opacity + opacity * look.transparency * rgb
        self._casters[CasterMap.ALBEDO].program["color"] = tuple(rgb - passing)
        self._casters[CasterMap.TRANSMISSION].program["transmission"] = tuple(passing)
        if mapping.key != self._mapping.key:
            self._displacement.lay(mapped_coordinates(self._vertices.attributes, mapping))
        self._mapping = mapping
        self._image = None if mapping.texture < 0 else self._assets.texture(mapping.texture)
        if mapping.kind not in self._programs:
            self._programs[mapping.kind] = self._program_of(mapping.kind)
        self._program, self._solid = self._programs[mapping.kind]
        if mapping.kind not in (MappingKind.NO_IMAGE, MappingKind.CUBE_IMAGE):
            self._program["tiling"] = mapping.tiling

    def _program_of(self, kind: MappingKind) -> tuple[moderngl.Program, moderngl.VertexArray]:
        """What the surface is drawn with into the G-buffer where its texture lies so."""
        resources = self._resources
        surface = self._surface
        displacement = self._displacement
        heatmap = int(self._heatmap is not None)
        grid = int(surface.grid > 0)
        program = resources.program("surfaces/surface", MAPPING=kind, HEATMAP=heatmap, GRID=grid)
        program["resolution"] = float(self._page.resolution)
        if grid:
            program["grid_spacing"] = float(surface.grid)
        content = [
            (displacement.moved, "4f", "in_moved"),
            (displacement.vertices, *displacement.KEPT),
        ]
        # what a program does not use is optimised away
        return program, resources.vertex_array(program, content, self._indices, skip_errors=True)

    def ripple(self, ctx: moderngl.Context, height_map: AnyHeightMap | None) -> None:
        """Take in a height map [C, n + 2, n + 2, 4] (none: flat), and find the triangles for it.

        `update` displaces the vertices. Raises `RippleError` if the height map has another shape.
        """
        if isinstance(height_map, MovedHeightMap):
            self._move(height_map.V)
            height_map = height_map.height_map
        if height_map is None:
            height_map = np.zeros(self._shape, dtype=np.float32)
        if height_map.shape != self._shape:
            raise RippleError(
                f"the height map of geom {self.geom} has shape {list(height_map.shape)}; valid is "
                f"{list(self._shape)}: charts with a halo of one texel, gradient and height"
            )
        if not isinstance(height_map, np.ndarray) and height_map.gl is not self._gl:
            height_map = np.asarray(height_map)  # it is in the memory of another device
        self._highest = self._height_maps.write(self._layer, height_map)
        if isinstance(height_map, np.ndarray):
            triangles, midpoints = self._adaptive(height_map)
            if triangles is not self._written:
                self._indices.write(triangles)
                self._written = triangles
            self._count = triangles.size
        else:
            self._height_maps.bind()
            if self._on_device is None:
                self._on_device = DeviceTessellation(
                    self._resources, self._adaptive, self._page, self._layer, self._indices
                )
            self._on_device.run(ctx)
            midpoints = self._on_device.midpoints
            self._count = self._on_device.command
            self._written = None
        self._displacement.use(midpoints)

    def update(
        self, rotation: NDArray[np.float64], origin: NDArray[np.float64], occluders: Occluders
    ) -> None:
        """Displace the vertices by the height map where the geom is, among bound occluders."""
        self._pose = rotation, origin
        near = int(occluders.near(self.ball(), np.array([self.geom]))[0])
        bias = min(1.5 * self._highest, _HIGHEST_BIAS * self._radius)
        self._objects.place(self.numbers[0], bias, rotation=rotation)
        self._height_maps.bind()
        self._displacement.run(rotation, origin, near)

    def _move(self, V: NDArray[np.float64]) -> None:
        """Take the vertices along with those of the mesh, [n, 3] [m]."""
        if self._moving is None:
            columns = (POSITION, DIRECTION, NORMAL, BAKED)
            rest, along, upright, baked = (self._vertices.attributes[:, each] for each in columns)
            vertices = MovingVertices(*self._mesh, rest, along, upright)
            self._moving = vertices, MovingOcclusion(*self._mesh, rest, along, baked)
        vertices, occlusion = self._moving
        points, directions, normals = vertices(V)
        self._displacement.move(points, directions, normals, occlusion(V))
        self._balls = balls_about(V[self._mesh[1]], _BALLS)
        self._middle = (V.min(axis=0) + V.max(axis=0)) / 2
        # in steps, so that shadow maps stay as they are while the surface wobbles
        need = 1.02 * float(np.linalg.norm(V - self._middle, axis=1).max())
        self._reach = max(self._reach, float(2 ** (np.ceil(8 * np.log2(need)) / 8)))

    def set_heatmap(self, values: NDArray[np.float32], limit: float) -> None:
        """Replace the heatmap's values, [C, n + 2, n + 2] with a halo; the colours range from -limit to limit.

        Raises `RippleError` if the surface has no heatmap, the shape is another, or the limit is
        not a positive, finite number.
        """
        if self._heatmap is None:
            raise RippleError(f"geom {self.geom} has no heatmap; give its `Surface` heatmap_colors")
        self._heatmap.set(values, limit)

    def ball(self) -> NDArray[np.float64]:
        """Ball [1, 4] about the geom's origin that contains the displaced mesh; it is the same as the geom turns."""
        rotation, origin = self._pose
        return np.array([[*(origin + rotation @ self._middle), self._reach + self._highest]])

    def bounds(self, data: Any = None) -> NDArray[np.float64]:
        """Balls [k, 4] that together contain the displaced mesh, where it was updated last."""
        rotation, origin = self._pose
        return np.column_stack(
            [self._balls[:, :3] @ rotation.T + origin, self._balls[:, 3] + self._highest]
        )

    def draw(self) -> None:
        """Draw into the G-buffer."""
        if self._image is not None:
            self._image.use(self._mapping.unit)
        if self._heatmap is not None:
            self._heatmap.use(self._program)
        self._program["rotation"] = tuple(self._pose[0].T.ravel())
        self._program["color"] = self._color
        self._render(self._solid, self._count)

    def cast(self, seen: CasterMap, **uniforms: Any) -> None:
        """Draw into a map of a light or of the floor; see `DrawnScene.cast`."""
        casters = self._casters[seen]
        for name, value in uniforms.items():
            casters.program[name] = value
        self._render(casters, self._count if seen == CasterMap.TRANSMISSION else -1)

    def _render(self, triangles: moderngl.VertexArray, count: int | moderngl.Buffer) -> None:
        """Render so many indices, -1: all; where back faces are culled, both sides of an open surface."""
        with self._gl as ctx:
            if self._open:
                ctx.disable(moderngl.CULL_FACE)
            if isinstance(count, moderngl.Buffer):  # of an indirect draw call
                triangles.render_indirect(count, count=1)
            else:
                triangles.render(vertices=count)
            if self._open:
                ctx.enable(moderngl.CULL_FACE)
