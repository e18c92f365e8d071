"""A target on the GPU: a mesh that its height map displaces.

The draw calls of a target: into the G-buffer, with its texture, heatmap and grid, and its depth.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import is_soft
from ripple_sim.render.camera import Balls, balls_about
from ripple_sim.render.contract import MappingKind
from ripple_sim.render.resources import AnyHeightMap, HeightMapTextures, MovedHeightMap
from ripple_sim.render.visuals.geoms import Occluders
from ripple_sim.render.visuals.instances import Assets
from ripple_sim.render.visuals.texture_mapping import Mapping
from ripple_sim.solver.errors import RippleError

from .adaptive import PIXELS, SurfaceTriangles
from .displacement import Displacement, Place
from .moving import MovingOcclusion, MovingVertices
from .surface import HeatmapTexture, Surface, appearance, load_image
from .vertices import BAKED, DIRECTION, NORMAL, POSITION, BoundedVertices, bounded_vertices, mapped_coordinates


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
        self._program = resources.program("surfaces/surface", **options)
        depth = resources.program("passes/casters", MOVED=1, ALBEDO_MAP=0, TRANSMISSION_MAP=0)
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
        albedo = resources.program("passes/casters", MOVED=1, ALBEDO_MAP=1, TRANSMISSION_MAP=0)
        albedo["color"] = tuple(paint.color[:3] - paint.transmission)
        self._albedo = resources.vertex_array(albedo, content[:1], coarse)
        transmission = resources.program(
            "passes/casters", MOVED=1, ALBEDO_MAP=0, TRANSMISSION_MAP=1, SOLID=int(not surface.open)
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


_PIXELS_PER_FACE = 192  # of the frame: fewer than about eight pixels each cost more than they show
_BALLS = 16  # that bound a mesh that moves
_HIGHEST_BIAS = 0.015  # of shadows, in radii


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
    transparent : bool
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
        self._middle = np.zeros(3)  # of what is soft its own, of a geom that of its frame
        if is_soft(assets.model, geom):
            self._middle = (surface.V.min(axis=0) + surface.V.max(axis=0)) / 2
        self._radius = self._reach = float(np.linalg.norm(surface.V - self._middle, axis=1).max())
        look, rgb, mapping = appearance(assets.model, geom, surface)
        self.transparent = look.transparency > 0.0
        self.number = assets.objects.add(
            look,
            geom,
            size=self._radius,
            heatmap=surface.heatmap_colors is not None,
            height_map=index,
        )
        assets.objects.set_chart(self.number, surface.charts.page.block)
        pixel = 2 * self._radius / size[1]
        bounded = bounded_vertices(surface, pixel * PIXELS, size[0] * size[1] // _PIXELS_PER_FACE)
        vertices, self._balls = bounded.vertices, bounded.balls
        self._triangles = SurfaceTriangles(assets.resources, vertices, surface.charts, index, pixel)
        self._displacement = Displacement(assets.resources, vertices, index)
        paint = Paint(surface, mapping, (*rgb, float(self.number)), look.transparency * rgb)
        self._drawing = SurfaceDrawing(assets, paint, bounded, self._displacement.moved, self._triangles.indices)
        self._mesh, self._vertices = surface.moving or (surface.V, surface.F), vertices
        self._moving: tuple[MovingVertices, MovingOcclusion] | None = None

    def ripple(self, ctx: moderngl.Context, height_map: AnyHeightMap | None) -> None:
        """Take in a height map [C, n + 2, n + 2, 4] (none: flat), and find the triangles for it.

        Storage buffers are bound for that; `update` displaces the vertices.

        Raises
        ------
        RippleError
            If the height map has another shape.
        """
        if isinstance(height_map, MovedHeightMap):
            self._move(height_map.V)
            height_map = height_map.height_map
        shape = (*self._charts.halo_shape, 4)
        if height_map is None:
            height_map = np.zeros(shape, dtype=np.float32)
        if height_map.shape != shape:
            raise RippleError(
                f"the height map of geom {self.geom} has shape {list(height_map.shape)}; valid is {list(shape)}: "
                "charts with a halo of one texel, gradient and height"
            )
        if not isinstance(height_map, np.ndarray) and height_map.gl is not self._gl:
            height_map = np.asarray(height_map)  # it is in the memory of another device
        self._highest = self._height_maps.write(self._layer, height_map)
        if isinstance(height_map, np.ndarray):
            self._triangles.find(height_map)
        else:
            self._height_maps.bind()
            self._triangles.find_on_device(ctx)

    def update(
        self, ctx: moderngl.Context, rotation: NDArray[np.float64], origin: NDArray[np.float64], occluders: Occluders
    ) -> None:
        """Displace the vertices by the height map where the geom is, among bound occluders."""
        self._pose = rotation, origin
        near = occluders.near(self.ball(), np.array([self.geom]))
        bias = min(1.5 * self._highest, _HIGHEST_BIAS * self._radius)
        self._objects.set_height_map(self.number, bias, rotation)
        self._height_maps.bind()
        self._displacement.run(ctx, Place(rotation, origin, int(near[0])), self._triangles.midpoints)

    def _move(self, V: NDArray[np.float64]) -> None:
        """Take the vertices along with those of the mesh, [n, 3] [m]."""
        if self._moving is None:
            columns = (POSITION, DIRECTION, NORMAL, BAKED)
            points, directions, normals, baked = (self._vertices.attributes[:, each] for each in columns)
            vertices = MovingVertices(*self._mesh, points, directions, normals)
            self._moving = vertices, MovingOcclusion(*self._mesh, points, directions, baked)
        vertices, occlusion = self._moving
        moved = vertices(V)
        self._displacement.move(moved.points, moved.directions)
        self._drawing.move(moved.normals, occlusion(V))
        self._balls = balls_about(V[self._mesh[1]], _BALLS)
        self._middle = (V.min(axis=0) + V.max(axis=0)) / 2
        # in steps, so that shadow maps stay as they are while the surface wobbles
        need = 1.02 * float(np.linalg.norm(V - self._middle, axis=1).max())
        self._reach = max(self._reach, float(2 ** (np.ceil(8 * np.log2(need)) / 8)))

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
        rotation, origin = self._pose
        return Balls((origin + rotation @ self._middle)[None], np.array([self._reach + self._highest]))

    def balls(self) -> Balls:
        """Balls that together contain the displaced mesh."""
        centres, radii = self._balls
        return Balls(centres @ self._pose[0].T + self._pose[1], radii + self._highest)

    def draw(self) -> None:
        """Draw into the G-buffer."""
        with self._sides():
            self._drawing.draw(self._pose[0], self._triangles.count)

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth only, under a matrix of 16 numbers, column by column."""
        with self._sides():
            self._drawing.draw_depth(view_projection)

    def draw_albedo(self, view_projection: tuple[float, ...]) -> None:
        """Draw in the linear colour, likewise."""
        with self._sides():
            self._drawing.draw_albedo(view_projection)

    def draw_transmission(self, view_projection: tuple[float, ...], light: int) -> None:
        """Draw into the transmission map of a light, likewise."""
        with self._sides():
            self._drawing.draw_transmission(view_projection, light, self._triangles.count)

    @contextlib.contextmanager
    def _sides(self) -> Iterator[None]:
        """Where back faces are culled: cull none of an open surface."""
        with self._gl as ctx:
            if self._open:
                ctx.disable(moderngl.CULL_FACE)
            yield
            if self._open:
                ctx.enable(moderngl.CULL_FACE)
