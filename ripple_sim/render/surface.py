"""A target: a mesh whose surface a height texture displaces."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.gl import GLContext

from . import occlusion
from .color import linear, srgb_texture
from .field import UNDER_COLORS, FieldTexture
from .looks import find_look
from .meshes import corner_normals
from .subdivision import subdivide

_MAX_FACES = 40_000
_PACKAGE = "ripple_sim.render"
# columns of the vertex attributes while the mesh is refined
_POSITION, _DIRECTION, _SPHERE, _NORMAL, _BAKED, _UV = (
    slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 14), slice(14, 16),
)  # fmt: skip


@dataclass(frozen=True)
class Surface:
    """Geometry and look of a target, in the frame of its MuJoCo geom.

    Attributes
    ----------
    V : array, shape [n, 3]
        Vertices [m].
    F : array, shape [m, 3]
        Triangles, counter-clockwise from outside.
    sphere : array, shape [n, 3]
        Unit vectors: where the relief is looked up.
    resolution : int
        Texels N per edge of the relief's faces.
    look : str
        Name of one of `LOOKS`.
    color : tuple, optional
        sRGB, 0 to 1. By default the look's own.
    uv, image : optional
        Texture coordinates, shape [n, 2] or per corner [m, 3, 2], and the picture that they index.
    field_colors : array of uint8, shape [k, 3], optional
        sRGB, from the least to the greatest value of a scalar field that is drawn in place of the look; see
        `SurfaceMesh.set_field`.
    grid : int
        Texels between the lines of a grid that is drawn on the surface; 0: none.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    sphere: NDArray[np.float64]
    resolution: int
    look: str = "rubber"
    color: tuple[float, float, float] | None = None
    uv: NDArray[np.float64] | None = None
    image: Path | str | None = None
    field_colors: NDArray[np.uint8] | None = None
    grid: int = 0


class SurfaceMesh:
    """A target on the GPU, refined to the relief's texels so that silhouettes displace smoothly."""

    def __init__(self, gl: GLContext, geom: int, surface: Surface) -> None:
        self.geom = geom
        self.resolution = surface.resolution
        shows_field = surface.field_colors is not None
        self.look = UNDER_COLORS if shows_field else find_look(surface.look)
        self.clear = self.look.transparency > 0.0
        self.radius = float(np.linalg.norm(surface.V, axis=1).max())
        faces, vertices = _refined(surface)
        self.count = len(vertices)
        with gl as ctx:
            self._displace = gl.compute_shader(_PACKAGE, "displace")
            program = gl.program(
                _PACKAGE,
                "surface_vertex",
                "surface_fragment",
                CLEAR=int(self.clear),
                FIELD=int(shows_field),
                GRID=int(surface.grid > 0),
            )
            depth = gl.program(_PACKAGE, "surface_depth_vertex", "depth_fragment")
            texels = surface.resolution + 2
            self._relief = ctx.texture_array((texels, texels, 6), 4, dtype="f4")
            self._relief.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self._relief.repeat_x = self._relief.repeat_y = False
            self._rest = ctx.buffer(_packed(vertices, _POSITION, _DIRECTION, _SPHERE))
            self._moved = ctx.buffer(reserve=12 * self.count)
            still = ctx.buffer(_packed(vertices, _NORMAL, _SPHERE, _BAKED, _UV))
            indices = ctx.buffer(faces.astype("i4").tobytes())
            self._solid = ctx.vertex_array(
                program,
                [
                    (self._moved, "3f", "in_world"),
                    (still, "3f 3f 2f 2f", "in_normal", "in_sphere", "in_baked", "in_uv"),
                ],
                indices,
            )
            self._depth = ctx.vertex_array(depth, [(self._moved, "3f", "in_world")], indices)
            self._image = None if shows_field else _load_image(ctx, surface)
            self._field = None if surface.field_colors is None else FieldTexture(ctx, texels, surface.field_colors)
        self._grid = surface.grid
        look = self.look
        color = None if shows_field else surface.color
        self._color = (*linear(color or look.color), float(self._image is not None))
        self._base = (look.roughness, look.metallic, look.sheen, look.coat)
        self._volume = (look.translucency, look.transparency, float(geom))

    def update(
        self,
        ctx: moderngl.Context,
        rotation: NDArray[np.float64],
        origin: NDArray[np.float64],
        relief: NDArray[np.float32] | None,
    ) -> None:
        """Take in a relief (none: flat) and put the displaced vertices where the geom is."""
        shape = (6, self.resolution + 2, self.resolution + 2, 4)
        if relief is None:
            relief = np.zeros(shape, dtype=np.float32)
        if relief.shape != shape:
            raise RippleError(
                f"the relief of geom {self.geom} has shape {list(relief.shape)}; resolution {self.resolution} needs "
                f"{list(shape)}: six faces padded by one texel, gradient and height"
            )
        self._origin, self._highest = np.array(origin), float(np.abs(relief[..., 3]).max())
        self._relief.write(np.ascontiguousarray(relief, dtype=np.float32))
        self._relief.use(0)
        self._rest.bind_to_storage_buffer(0)
        self._moved.bind_to_storage_buffer(1)
        self._rotation = tuple(rotation.T.ravel())
        self._displace["rotation"] = self._rotation
        self._displace["origin"] = tuple(origin)
        self._displace["count"] = self.count
        self._displace.run(-(-self.count // 64))
        ctx.memory_barrier()

    def set_field(self, field: NDArray[np.float32], limit: float) -> None:
        """Take in the scalar field that is shown, [6, N + 2, N + 2], padded like a relief.

        The colours reach from -limit to limit. The surface must have `field_colors`.
        """
        if self._field is None:
            raise RippleError(f"geom {self.geom} shows no field; give its `Surface` field_colors")
        self._field.set(field, limit)

    def ball(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounding ball of the displaced mesh in the world: centre [1, 3] and radius [1], in metres."""
        return self._origin[None], np.array([self.radius + self._highest])

    def draw(self) -> None:
        """Draw the shaded surface."""
        program = self._solid.program
        self._relief.use(0)
        if self._image is not None:
            self._image.use(5)
        program["rotation"] = self._rotation
        program["color"] = self._color
        program["base"] = self._base
        program["volume"] = (*self._volume, min(1.5 * self._highest, 0.05 * self.radius))
        program["size"] = self.radius
        if self._field is not None:
            self._field.use(program)
        if self._grid:
            program["grid_spacing"] = float(self._grid)
        self._solid.render()

    def draw_depth(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth alone, under a matrix of 16 numbers, column by column."""
        self._depth.program["view_projection"] = view_projection
        self._depth.render()


def _refined(surface: Surface) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Triangles and vertex attributes (see the columns above), split where normals or texture coordinates jump."""
    V, F = np.asarray(surface.V, dtype=np.float64), np.asarray(surface.F, dtype=np.int64)
    smooth = np.zeros_like(V)
    smooth[F] = corner_normals(V, F, crease=180.0)
    baked = np.stack(occlusion.bake(V, F, smooth), axis=1)
    uv = np.zeros((len(V), 2)) if surface.uv is None else np.asarray(surface.uv, dtype=np.float64)
    corner_uv = uv[F] if uv.ndim == 2 else uv
    corners = np.concatenate([F[:, :, None], corner_normals(V, F), corner_uv], axis=2).reshape(-1, 6)
    unique, index = np.unique(corners, axis=0, return_inverse=True)
    vertex = unique[:, 0].astype(np.int64)
    attributes = np.concatenate(
        [V[vertex], smooth[vertex], surface.sphere[vertex], unique[:, 1:4], baked[vertex], unique[:, 4:]], axis=1
    )
    return subdivide(
        index.reshape(F.shape), attributes, _SPHERE, max_angle=np.pi / 2 / surface.resolution, max_faces=_MAX_FACES
    )


def _packed(vertices: NDArray[np.float64], *columns: slice) -> bytes:
    return np.concatenate([vertices[:, c] for c in columns], axis=1).astype(np.float32).tobytes()


def _load_image(ctx: moderngl.Context, surface: Surface) -> moderngl.Texture | None:
    if surface.image is None or surface.uv is None:
        return None
    try:
        picture = Image.open(surface.image).convert("RGB")
    except OSError as error:
        raise RippleError(f"texture image {surface.image} cannot be read: {error}") from error
    return srgb_texture(ctx, np.asarray(picture)[::-1])
