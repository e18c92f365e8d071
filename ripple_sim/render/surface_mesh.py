"""A rippling surface on the GPU."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId, is_geom
from ripple_sim.render.surfaces.adaptive import AdaptiveTessellation, DeviceTessellation
from ripple_sim.render.surfaces.displacement import Displacement
from ripple_sim.render.surfaces.moving import MovingOcclusion, MovingVertices
from ripple_sim.render.surfaces.surface import HeatmapTexture, Surface, appearance
from ripple_sim.render.surfaces.tessellation import BAKED, DIRECTION, NORMAL, POSITION
from ripple_sim.render.surfaces.vertices import mapped_coordinates, surface_vertices
from ripple_sim.render.visuals.objects import Assets, Occluders
from ripple_sim.render.visuals.texture_mapping import TextureMapping, glow_texture
from ripple_sim.render.visuals.visual import Visual, target_visual, texture_has_opacity
from ripple_sim.solver.errors import RippleError

from .bounds import balls_about
from .contract import CasterMap, MappingKind, Shading, Texels, Unit
from .height_map_textures import AnyHeightMap, HeightMapTextures, MovedHeightMap

# Length of an edge [pixels], where the target fills the frame's height.
_EDGE_LENGTH = 5.6

# Distance between the waves and an edge from which the edge is split [pixels], likewise.
_SPLIT_TOLERANCE = 0.25

# Edges shorter than this many times the ordinary edge length are not split.
_MIN_SPLIT_LENGTH = 1.5

# Pixels of the frame a face, at least: smaller faces cost more than they show.
_PIXELS_PER_FACE = 192

# Balls that bound a mesh that moves.
_BALL_COUNT = 16

# Bias of shadows: in heights of the highest wave, and at most [radii of the target].
_BIAS_PER_HEIGHT = 1.5
_MAX_BIAS = 0.015

# The ball about a mesh that moves is this much larger than the mesh, and grows in steps of an
# eighth of an octave, so that shadow maps stay as they are while the surface wobbles.
_REACH_MARGIN = 1.02
_REACH_STEPS_PER_OCTAVE = 8


class SurfaceMesh:
    """A target on the GPU, as a mesh that the height map displaces.

    Its triangles are a few pixels wide, so that the outline is round and the displacement smooth.
    Where waves are sharp, a frame has up to four triangles in place of one. An open surface shows
    both of its sides.

    Parameters
    ----------
    geom : int
        Geom id of the target.
    height_maps : HeightMapTextures
        Height maps of all targets.
    index : int
        Index of the target among all targets, which is the layer of its height map.
    size : (width, height)
        Size of the frame [pixels].

    Attributes
    ----------
    numbers : list of int
        The target's number in the table of objects, and that of its clear texels.
    clear_texels : ClearTexels or None
        What is drawn as an object of its own, where the texture is neither opaque nor clear.
    transparent : bool
        Whether the scene behind the target shows through.
    blocks : bool
        Whether no light passes through the target.
    occludes : bool
        Whether the target hides the sky from objects below it; every target does.
    casts : bool
        Whether the target casts shadows; every target does.
    """

    def __init__(
        self,
        assets: Assets,
        geom: TargetId,
        surface: Surface,
        height_maps: HeightMapTextures,
        index: int,
        size: tuple[int, int],
    ) -> None:
        resources = assets.resources
        page = surface.charts.page
        self.geom = geom
        self._is_open = surface.open
        self._gl = resources.gl
        self._resources = resources
        self._assets = assets
        self._objects = assets.objects
        self._height_maps = height_maps
        self._layer = index
        self._page = page
        self._shape = (page.charts, page.block, page.block, 4)  # of the height map
        # middle of the ball about the target: a geom's origin, or the middle of a soft mesh [m]
        self._middle = np.zeros(3)
        if not is_geom(geom, assets.model):
            self._middle = (surface.V.min(axis=0) + surface.V.max(axis=0)) / 2
        self._radius = float(np.linalg.norm(surface.V - self._middle, axis=1).max())  # at rest [m]
        self._reach = self._radius  # of the ball about the mesh, as far as it has moved [m]
        visual = target_visual(assets.model, geom)
        look, _, mapping = appearance(assets.model, visual, surface)
        self.occludes = True
        self.casts = True
        self.is_plane = False
        has_heatmap = surface.heatmap_colors is not None
        self.numbers = [
            assets.objects.add(
                look,
                geom,
                identity=visual.identity,
                size=self._radius,
                shading=shading,
                height_map=index,
                chart=page.block,
            )
            for shading in (Shading.HEATMAP if has_heatmap else Shading.USUAL, Shading.CLEAR)
        ]
        pixel = 2 * self._radius / size[1]  # [m], where the target fills the frame's height
        max_faces = size[0] * size[1] // _PIXELS_PER_FACE
        vertices = surface_vertices(surface, pixel * _EDGE_LENGTH, max_faces)
        self._vertices = vertices
        self._balls = vertices.balls
        self._adaptive = AdaptiveTessellation(
            vertices,
            page,
            _SPLIT_TOLERANCE * pixel,
            min_length=_MIN_SPLIT_LENGTH * _EDGE_LENGTH * pixel,
        )
        # up to four triangles for each face
        self._indices = resources.buffer(reserve=4 * 12 * len(vertices.F), dynamic=True)
        self._written: NDArray[np.int32] | None = None  # the triangles in the buffer
        self._on_device: DeviceTessellation | None = None
        # number of indices, or a buffer with an indirect draw call
        self._count: int | moderngl.Buffer
        mapped = mapped_coordinates(vertices.attributes, mapping)
        self._displacement = Displacement(resources, vertices, mapped, index)
        self._mesh = surface.moving or (surface.V, surface.F)
        self._moving: tuple[MovingVertices, MovingOcclusion] | None = None
        colors = surface.heatmap_colors
        self._heatmap = None if colors is None else HeatmapTexture(resources, page, colors)
        # for the G-buffer, and for the maps
        self._solids: dict[tuple[MappingKind, Texels, bool], moderngl.VertexArray] = {}
        self._casters: dict[tuple[CasterMap, Texels], moderngl.VertexArray] = {}
        self._is_lens = not self._is_open and look.transparency > 0.0
        # triangles in the maps: depths need no triangles that are split along waves, and colours on
        # the floor only coarse triangles
        self._caster_indices = {
            CasterMap.DEPTH: resources.buffer(vertices.F.astype("i4").tobytes()),
            CasterMap.ALBEDO: resources.buffer(vertices.coarse.astype("i4").tobytes()),
            CasterMap.TRANSMISSION: self._indices,
        }
        self._surface = surface
        self._mapping = mapping
        self.paint(visual)

    def paint(self, visual: Visual) -> None:
        """Take colour, material and texture from the visual of the target's geom."""
        look, rgb, mapping = appearance(self._assets.model, visual, self._surface)
        opacity = visual.opacity or 1.0  # targets that MuJoCo does not show are drawn all the same
        explains = self._heatmap is not None or self._surface.grid > 0
        glow = -1 if explains else glow_texture(self._assets.model, visual, mapping)
        self._glow = None if glow < 0 else self._assets.texture(glow)
        usual = Shading.USUAL if glow < 0 else Shading.GLOWING
        solid = Shading.HEATMAP if self._heatmap is not None else usual
        for number, shading in zip(self.numbers, (solid, Shading.CLEAR), strict=True):
            self._objects.paint(number, look, opacity, shading)
        self.transparent = look.transparency > 0.0 or opacity < 1.0
        self.blocks = not self.transparent
        self._rgb = rgb
        # linear colour of the light that passes through the target
        self._passing = 1.0 - opacity + opacity * look.transparency * rgb
        if mapping.key != self._mapping.key:
            self._displacement.lay(mapped_coordinates(self._vertices.attributes, mapping))
        self._mapping = mapping
        self._image = None if mapping.texture < 0 else self._assets.texture(mapping.texture)
        self._texels = self._shown_texels(mapping)
        self.clear_texels = ClearTexels(self) if self._texels == Texels.OPAQUE_TEXELS else None

    def _shown_texels(self, mapping: TextureMapping) -> Texels:
        """Which texels of a texture the target itself shows, beside its clear texels."""
        texture = mapping.texture
        is_flat = mapping.kind == MappingKind.FLAT_IMAGE
        if not is_flat or not texture_has_opacity(self._assets.model, texture):
            return Texels.ALL_TEXELS
        explains = self._heatmap is not None or self._surface.grid > 0
        if self.transparent or explains or not self._assets.is_half_clear(texture):
            return Texels.HALF_OPAQUE_TEXELS
        return Texels.OPAQUE_TEXELS

    def _solid(self, texels: Texels) -> moderngl.VertexArray:
        """Vertex array with the program that draws some texels into the G-buffer."""
        key = self._mapping.kind, texels, self._glow is not None
        if key not in self._solids:
            surface = self._surface
            program = self._resources.program(
                "surfaces/surface",
                MAPPING=self._mapping.kind,
                HEATMAP=int(self._heatmap is not None),
                GRID=int(surface.grid > 0),
                TEXELS=texels,
                GLOW=int(self._glow is not None),
            )
            program["resolution"] = float(self._page.resolution)
            if surface.grid:
                program["grid_spacing"] = float(surface.grid)
            self._solids[key] = self._vertex_array(program, self._indices)
        return self._solids[key]

    def _caster(self, seen: CasterMap, texels: Texels) -> moderngl.VertexArray:
        """Vertex array with the program that draws some texels into maps of a kind."""
        if (seen, texels) not in self._casters:
            program = self._resources.program(
                "passes/casters",
                MOVED=1,
                MAP=seen,
                SOLID=int(self._is_lens),
                MAPPING=MappingKind.FLAT_IMAGE,
                TEXELS=texels,
            )
            triangles = self._caster_indices[seen]
            self._casters[seen, texels] = self._vertex_array(program, triangles)
        return self._casters[seen, texels]

    def _vertex_array(
        self, program: moderngl.Program, triangles: moderngl.Buffer
    ) -> moderngl.VertexArray:
        displacement = self._displacement
        content = [
            (displacement.moved, "4f", "in_moved"),
            (displacement.vertices, *displacement.KEPT),
        ]
        # drivers remove attributes that a program does not use
        return self._resources.vertex_array(program, content, triangles, skip_errors=True)

    def ripple(self, ctx: moderngl.Context, height_map: AnyHeightMap | None) -> None:
        """Read a height map, and choose the triangles for it; `update` displaces the vertices.

        Parameters
        ----------
        height_map : array, shape [C, n + 2, n + 2, 4], or None
            Gradient and height; None stands for a flat surface.

        Raises
        ------
        RippleError
            If the height map has another shape.
        """
        if isinstance(height_map, MovedHeightMap):
            self._move(height_map.V)
            height_map = height_map.height_map
        if height_map is None:
            height_map = np.zeros(self._shape, dtype=np.float32)
        if height_map.shape != self._shape:
            raise RippleError(
                f"the height map of geom {self.geom} must have shape {list(self._shape)} "
                "(charts with a halo of one texel, gradient and height), got "
                f"{list(height_map.shape)}"
            )
        if not isinstance(height_map, np.ndarray) and height_map.gl is not self._gl:
            height_map = np.asarray(height_map)  # from the memory of another device
        self._highest = self._height_maps.write(self._layer, height_map)
        if isinstance(height_map, np.ndarray):
            self._tessellate(height_map)
        else:
            self._tessellate_on_device(ctx)

    def _tessellate(self, height_map: NDArray[np.float32]) -> None:
        """Choose the triangles for a height map in the host's memory."""
        triangles, midpoints = self._adaptive(height_map)
        if triangles is not self._written:
            self._indices.write(triangles)
            self._written = triangles
        self._count = triangles.size
        self._displacement.use(midpoints)

    def _tessellate_on_device(self, ctx: moderngl.Context) -> None:
        """Choose the triangles for a height map on the GPU, on the GPU."""
        self._height_maps.bind()
        if self._on_device is None:
            self._on_device = DeviceTessellation(
                self._resources, self._adaptive, self._page, self._layer, self._indices
            )
        self._on_device.run(ctx)
        self._count = self._on_device.command
        self._written = None
        self._displacement.use(self._on_device.midpoints)

    def update(
        self, rotation: NDArray[np.float64], origin: NDArray[np.float64], occluders: Occluders
    ) -> None:
        """Displace the vertices by the height map, at the pose of the geom.

        The `occluders` must be bound.
        """
        self._pose = rotation, origin
        near_occluders = int(occluders.near(self.ball(), np.array([self.geom]))[0])  # a bit each
        shadow_bias = min(_BIAS_PER_HEIGHT * self._highest, _MAX_BIAS * self._radius)  # [m]
        for number in self.numbers:
            self._objects.place(number, shadow_bias, rotation=rotation)
        self._height_maps.bind()
        self._displacement.run(rotation, origin, near_occluders)

    def _move(self, V: NDArray[np.float64]) -> None:
        """Move the vertices with the vertices `V` [n, 3] of the target's mesh [m]."""
        if self._moving is None:
            attributes = self._vertices.attributes
            position = attributes[:, POSITION]
            direction = attributes[:, DIRECTION]
            normal = attributes[:, NORMAL]
            rest_V, F = self._mesh
            self._moving = (
                MovingVertices(rest_V, F, position, direction, normal),
                MovingOcclusion(rest_V, F, position, direction, attributes[:, BAKED]),
            )
        vertices, occlusion = self._moving
        points, directions, normals = vertices(V)
        self._displacement.move(points, directions, normals, occlusion(V))
        self._balls = balls_about(V[self._mesh[1]], _BALL_COUNT)
        self._middle = (V.min(axis=0) + V.max(axis=0)) / 2
        needed_reach = _REACH_MARGIN * float(np.linalg.norm(V - self._middle, axis=1).max())
        steps = np.ceil(_REACH_STEPS_PER_OCTAVE * np.log2(needed_reach))
        self._reach = max(self._reach, float(2 ** (steps / _REACH_STEPS_PER_OCTAVE)))

    def set_heatmap(self, values: NDArray[np.float32], limit: float) -> None:
        """Replace the heatmap's values, which have a halo; the colours range from -limit to limit.

        Raises `RippleError` if the surface has no heatmap, the shape is not [C, n + 2, n + 2], or
        the limit is not a positive, finite number.
        """
        if self._heatmap is None:
            raise RippleError(f"geom {self.geom} has no heatmap; give its `Surface` heatmap_colors")
        self._heatmap.set(values, limit)

    def ball(self) -> NDArray[np.float64]:
        """Ball [1, 4] that contains the displaced mesh.

        Its size stays the same while the geom turns.
        """
        rotation, origin = self._pose
        centre = origin + rotation @ self._middle
        return np.array([[*centre, self._reach + self._highest]])

    def bounds(self, data: Any = None) -> NDArray[np.float64]:
        """Balls [k, 4] that together contain the displaced mesh, at the pose of the last update."""
        rotation, origin = self._pose
        centres = self._balls[:, :3] @ rotation.T + origin
        radii = self._balls[:, 3] + self._highest
        return np.column_stack([centres, radii])

    def draw(self) -> None:
        """Draw into the G-buffer, without the clear texels."""
        self.draw_texels(self._texels, self.numbers[0])

    def draw_texels(self, texels: Texels, number: int) -> None:
        """Draw some texels into the G-buffer, as an object of a number."""
        solid = self._solid(texels)
        program = solid.program
        if self._image is not None:
            self._image.use(self._mapping.unit)
        if self._glow is not None:
            self._glow.use(Unit.GLOW_IMAGE)
        if self._mapping.kind not in (MappingKind.NO_IMAGE, MappingKind.CUBE_IMAGE):
            program["tiling"] = self._mapping.tiling
        if self._heatmap is not None:
            self._heatmap.use(program)
        program["rotation"] = tuple(self._pose[0].T.ravel())
        program["color"] = (*self._rgb, float(number))
        self._render(solid, self._count)

    def cast(self, seen: CasterMap, **uniforms: Any) -> None:
        """Draw into a map of a light or of the floor; see `DrawnScene.cast`."""
        self.cast_texels(self._texels, seen, **uniforms)

    def cast_texels(self, texels: Texels, seen: CasterMap, **uniforms: Any) -> None:
        """Draw some texels into a map of a light or of the floor."""
        casters = self._caster(seen, texels)
        if seen == CasterMap.ALBEDO:
            uniforms["color"] = tuple(self._rgb - self._passing)
        elif seen == CasterMap.TRANSMISSION:
            uniforms["transmission"] = tuple(self._passing)
        if texels != Texels.ALL_TEXELS and self._image is not None:
            self._image.use(self._mapping.unit)
            uniforms["tiling"] = self._mapping.tiling
        for name, value in uniforms.items():
            casters.program[name] = value
        self._render(casters, self._count if seen == CasterMap.TRANSMISSION else -1)

    def _render(self, triangles: moderngl.VertexArray, count: int | moderngl.Buffer) -> None:
        """Render a number of indices, -1 for all.

        Both sides of an open surface are drawn, also where back faces are culled.
        """
        with self._gl as ctx:
            if self._is_open:
                ctx.disable(moderngl.CULL_FACE)
            if isinstance(count, moderngl.Buffer):  # of an indirect draw call
                triangles.render_indirect(count, count=1)
            else:
                triangles.render(vertices=count)
            if self._is_open:
                ctx.enable(moderngl.CULL_FACE)


class ClearTexels:
    """The texels of a target that are neither opaque nor clear, as a transparent object.

    They are drawn behind everything that is opaque. Where several lie behind each other, the
    nearest one is seen.

    Attributes
    ----------
    numbers : list of int
        Their number in the table of objects.
    transparent, blocks, occludes, casts, is_plane : bool
        As for `SurfaceMesh`.
    """

    transparent = True
    blocks = False
    occludes = False
    casts = True
    is_plane = False

    def __init__(self, target: SurfaceMesh) -> None:
        self._target = target
        self.numbers = target.numbers[1:]

    def bounds(self, data: Any = None) -> NDArray[np.float64]:
        """Balls [k, 4] that together contain them."""
        return self._target.bounds(data)

    def draw(self) -> None:
        """Draw into the G-buffer."""
        self._target.draw_texels(Texels.CLEAR_TEXELS, self.numbers[0])

    def cast(self, seen: CasterMap, **uniforms: Any) -> None:
        """Draw into a map of a light; see `DrawnScene.cast`."""
        self._target.cast_texels(Texels.CLEAR_TEXELS, seen, **uniforms)
