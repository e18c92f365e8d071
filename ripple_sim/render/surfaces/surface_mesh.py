"""A target on the GPU: a mesh whose surface a height texture displaces."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.object_table import ObjectTable
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.render.passes.screen_bounds import balls_about
from ripple_sim.render.visuals.materials import Textures
from ripple_sim.render.visuals.texture_mapping import CUBE_IMAGE, NO_IMAGE
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.gl import GLContext

from .height_maps import LAYERS, HeightMapTextures
from .refinement import Refinement
from .scalar_field import FieldTexture
from .surface import Surface, appearance, load_image
from .vertices import BAKED, DIRECTION, NORMAL, POSITION, SPHERE, mapped, packed, refined

_PIXELS = 4.0  # length of an edge where the target fills the frame's height
_PIXELS_PER_FACE = 48  # of the frame
_TOLERANCE = 0.15  # [pixels], likewise: an edge from which the waves depart further is split
_BALLS = 16  # that bound the mesh
_NO_SHADOW = 0.75  # transparency from which on light goes through as if nothing were there
_PACKAGE = "ripple_sim.render"


class SurfaceMesh:
    """A target on the GPU, cut into triangles of a few pixels so that silhouettes are round and displace smoothly.

    Where waves are sharp, a frame has up to four triangles in place of one.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    model : mujoco.MjModel
    geom : int
        The target's geom.
    surface : Surface
    textures : Textures
        Of the model.
    table : ObjectTable
        Takes a row for the target.
    height_maps : HeightMapTextures
        Takes the target's height map.
    index : int
        Of the target among those that have a height map there.
    size : (width, height)
        Of the frame [pixels].
    """

    def __init__(
        self,
        gl: GLContext,
        ctx: OwnedObjects,
        model: Any,
        geom: int,
        surface: Surface,
        textures: Textures,
        table: ObjectTable,
        height_maps: HeightMapTextures,
        index: int,
        size: tuple[int, int],
    ) -> None:
        self.geom = geom
        self.resolution = surface.resolution
        shows_field = surface.field_colors is not None
        look, rgb, mapping = appearance(model, geom, surface)
        self.clear = look.transparency > 0.0
        self.shades = look.transparency < _NO_SHADOW
        self.radius = float(np.linalg.norm(surface.V, axis=1).max())
        self._table, self._height_maps, self._first_layer = table, height_maps, LAYERS * index
        self.number = table.add(
            look, geom, size=self.radius, painted=shows_field, height_map=(self._first_layer, self.resolution)
        )
        pixel = 2 * self.radius / size[1]
        faces, vertices, edges = refined(surface, pixel * _PIXELS, size[0] * size[1] // _PIXELS_PER_FACE)
        middle = len(vertices) - len(edges.ends) + edges.of_side
        self._balls = balls_about(vertices[:, POSITION][np.concatenate([faces, middle])], _BALLS)
        self._refinement = Refinement(
            faces,
            edges,
            vertices[:, POSITION],
            vertices[:, SPHERE],
            self.resolution,
            tolerance=_TOLERANCE * pixel,
            min_length=1.5 * _PIXELS * pixel,
        )
        self._triangles: NDArray[np.int32] | None = None  # on the GPU
        self._displace = ctx.own(gl.compute_shader(_PACKAGE, "surfaces/displace"))
        self._program = ctx.own(
            gl.program(
                _PACKAGE,
                "surfaces/surface_vertex",
                "surfaces/surface_fragment",
                MAPPING=mapping.kind,
                FIELD=int(shows_field),
                GRID=int(surface.grid > 0),
            )
        )
        depth = ctx.own(gl.program(_PACKAGE, "surfaces/surface_depth_vertex", "glsl/depth_fragment"))
        self._rest = ctx.buffer(packed(vertices, POSITION, DIRECTION, SPHERE))
        self._moved = ctx.buffer(reserve=16 * len(vertices))
        self._midpoints = ctx.buffer(reserve=4 * len(edges.ends), dynamic=True)
        self._indices = ctx.buffer(reserve=4 * 12 * len(faces), dynamic=True)
        still = np.concatenate([vertices[:, NORMAL], vertices[:, SPHERE], vertices[:, BAKED]], axis=1)
        still = np.concatenate([still, mapped(vertices, mapping)], axis=1).astype("f4")
        self._solid = ctx.vertex_array(
            self._program,
            [
                (self._moved, "4f", "in_moved"),
                (ctx.buffer(still.tobytes()), "3f 3f 2f 3f", "in_normal", "in_sphere", "in_baked", "in_mapped"),
            ],
            self._indices,
            skip_errors=True,
        )
        self._depth = ctx.vertex_array(depth, [(self._moved, "4f", "in_moved")], self._indices)
        self._mapping = mapping
        self._image = None
        if mapping.kind != NO_IMAGE:
            self._image = textures.get(mapping.texture) if mapping.texture >= 0 else load_image(ctx, surface)
        self._field = (
            None if surface.field_colors is None else FieldTexture(ctx, self.resolution + 2, surface.field_colors)
        )
        self._grid = surface.grid
        self._color = (*rgb, float(self.number))

    def update(
        self,
        ctx: moderngl.Context,
        rotation: NDArray[np.float64],
        origin: NDArray[np.float64],
        height_map: NDArray[np.float32] | None,
        occluders: int,
    ) -> None:
        """Take in a height map (none: flat) and put the displaced vertices where the geom is."""
        shape = (6, self.resolution + 2, self.resolution + 2, 4)
        if height_map is None:
            height_map = np.zeros(shape, dtype=np.float32)
        if height_map.shape != shape:
            raise RippleError(
                f"the height map of geom {self.geom} has shape {list(height_map.shape)}; resolution {self.resolution} "
                f"needs {list(shape)}: six faces padded by one texel, gradient and height"
            )
        self._pose, self._highest = (np.array(rotation), np.array(origin)), float(np.abs(height_map[..., 3]).max())
        self._table.set_height_map(self.number, min(1.5 * self._highest, 0.05 * self.radius), rotation)
        triangles, middle = self._refinement(height_map)
        if triangles is not self._triangles:
            self._indices.write(triangles)
            self._triangles = triangles
        if len(middle):
            self._midpoints.write(middle)
        self._index_count, count = triangles.size, self._refinement.base_count + len(middle)
        self._height_maps.write(self._first_layer, height_map)
        self._height_maps.bind()
        self._rest.bind_to_storage_buffer(0)
        self._moved.bind_to_storage_buffer(1)
        self._midpoints.bind_to_storage_buffer(2)
        self._rotation = tuple(rotation.T.ravel())
        self._displace["rotation"] = self._rotation
        self._displace["origin"] = tuple(origin)
        self._displace["count"] = count
        self._displace["base_count"] = self._refinement.base_count
        self._displace["resolution"] = float(self.resolution)
        self._displace["geom"] = float(self.geom)
        self._displace["occluder_count"] = occluders
        self._displace["first_layer"] = float(self._first_layer)
        self._displace.run(-(-count // 64))
        ctx.memory_barrier()

    def set_field(self, field: NDArray[np.float32], limit: float) -> None:
        """Take in the scalar field that is shown, [6, N + 2, N + 2], padded like a height map.

        The colours reach from -limit to limit. The surface must have `field_colors`.
        """
        if self._field is None:
            raise RippleError(f"geom {self.geom} shows no field; give its `Surface` field_colors")
        self._field.set(field, limit)

    def ball(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Ball about the origin that holds the displaced mesh: centre [1, 3] in the world and radius [1], in metres."""
        return self._pose[1][None], np.array([self.radius + self._highest])

    def balls(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Balls in the world that together hold the displaced mesh: centres [k, 3] and radii [k], in metres."""
        centres, radii = self._balls
        return centres @ self._pose[0].T + self._pose[1], radii + self._highest

    def draw(self) -> None:
        """Draw into the geometry pass."""
        if self._image is not None:
            self._image.use(self._mapping.unit)
        if self._mapping.kind not in (NO_IMAGE, CUBE_IMAGE):
            self._program["tiling"] = self._mapping.tiling
        self._program["rotation"] = self._rotation
        self._program["color"] = self._color
        if self._field is not None:
            self._field.use(self._program)
        if self._grid:
            self._program["grid_spacing"] = float(self._grid)
        if self._field is not None or self._grid:
            self._program["resolution"] = float(self.resolution)
        self._solid.render(vertices=self._index_count)

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth alone, under a matrix of 16 numbers, column by column."""
        self._depth.program["view_projection"] = view_projection
        self._depth.render(vertices=self._index_count)
