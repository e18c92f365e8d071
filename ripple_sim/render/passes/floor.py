"""The floor: a plane that fades into the background, with the soft darkness under whatever is near it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import orthographic
from ripple_sim.render.gpu.color import linear
from ripple_sim.render.gpu.frame_uniforms import FrameUniforms
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.render.visuals.lights import Light
from ripple_sim.render.visuals.materials import Textures, texture_pixels
from ripple_sim.render.visuals.texture_mapping import FLAT_IMAGE, mapping_of
from ripple_sim.render.visuals.visual import geom_piece
from ripple_sim.solver.gl import GLContext

from .shadow import ShadowMaps

_PACKAGE = "ripple_sim.render"
_CEILING_UNIT = 3  # of the texture, in shaders/floor_occlusion_fragment.glsl
_CEILING_SIZE, _MAP_SIZE = 224, 112
_ENDLESS = 1e9  # half size of a plane without an end [m]
_SOFT = 0.1  # margin about shadows for their soft edges, in half widths of the map
_LOWEST_SINE = 0.02  # elevation of a lamp at which shadows have no end

_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(8, 3)  # of a box about a ball


def find_floor(model: Any, geoms: list[int]) -> int | None:
    """Return the plane that faces up most, or None."""
    rest = mujoco.MjData(model)
    mujoco.mj_kinematics(model, rest)
    planes = [geom for geom in geoms if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE]
    return max(planes, key=lambda geom: rest.geom_xmat[geom][8], default=None)


class Floor:
    """A model's floor plane. It is not drawn: the picture's shader meets it with a ray.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    model : mujoco.MjModel
    geom : int
        The plane.
    textures : Textures
    shadows : int
        How many lamps may cast shadows.
    """

    def __init__(
        self, gl: GLContext, ctx: OwnedObjects, model: Any, geom: int, textures: Textures, shadows: int
    ) -> None:
        self.geom = geom
        piece = geom_piece(model, geom)
        mapping = mapping_of(model, piece)
        self.albedo = piece.color
        self.tiled = mapping.kind == FLAT_IMAGE
        self.tiling, self.tint = mapping.tiling, self.albedo
        self._image = textures.get(mapping.texture) if self.tiled else None
        if self.tiled:
            self.albedo = self.tint * linear(texture_pixels(model, mapping.texture) / 255.0).mean(axis=(0, 1))
        self.reflectance = 0.0 if piece.material < 0 else float(model.mat_reflectance[piece.material])
        half = np.asarray(model.geom_size[geom][:2], dtype=np.float64)
        self._half = np.where(half > 0, half, _ENDLESS)
        options = {"NEAR_LAMPS": 1, "SHADOWS": shadows}
        self._occlude = ctx.vertex_array(
            ctx.own(gl.program(_PACKAGE, "glsl/screen_vertex", "passes/floor_occlusion_fragment", **options)), []
        )
        self._ceiling = ctx.depth_texture((_CEILING_SIZE, _CEILING_SIZE))
        self._ceiling.compare_func = ""
        self._ceiling.repeat_x = self._ceiling.repeat_y = False
        self._ceiling_target = ctx.framebuffer(depth_attachment=self._ceiling)
        self._openness = ctx.texture((_MAP_SIZE, _MAP_SIZE), 2, dtype="f2")
        self._openness.repeat_x = self._openness.repeat_y = False
        self._openness.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._openness_target = ctx.framebuffer([self._openness])

    def place(self, frame: FrameUniforms, data: Any, centre: NDArray, radius: float) -> None:
        """Set where the floor lies, and which part of it the occlusion map covers."""
        rotation = data.geom_xmat[self.geom].reshape(3, 3)
        self.origin, self._rotation = np.array(data.geom_xpos[self.geom]), rotation
        local = rotation.T @ (centre - self.origin)
        self._centre, self._half_width = local, 1.2 * radius
        frame.set_vector("floor_origin", self.origin, 1.0)
        frame.set_vector("floor_u", rotation[:, 0], self._half[0])
        frame.set_vector("floor_v", rotation[:, 1], self._half[1])
        frame.set_vector("floor_normal", rotation[:, 2])
        frame.set_vector("floor_albedo", self.albedo)
        frame.set_vector("floor_map", [local[0], local[1], self._half_width])

    def shade(self, frame: FrameUniforms, lights: list[Light], centres: NDArray, radii: NDArray) -> None:
        """Set the parts of the floor that the shadows of some balls [m] may fall on, for each light."""
        points = centres[:, None] + radii[:, None, None] * _CORNERS
        for shadow, light in zip(frame.values["shadows"], lights, strict=False):
            shadow["floor"] = self._shaded_box(light, points)

    def _shaded_box(self, light: Light, points: NDArray) -> NDArray[np.float64]:
        """Lower and upper corner, in the occlusion map, of a box about the shadows of points [m]."""
        towards = light.direction if light.position is None else light.position - points
        height = np.maximum((points - self.origin) @ self.normal, 0.0)
        rise = np.broadcast_to(towards @ self.normal, height.shape)
        low = rise < _LOWEST_SINE * np.linalg.norm(towards, axis=-1)
        shadows = points - towards * (height / np.where(low, 1.0, rise))[..., None]
        local = ((shadows - self.origin) @ self._rotation)[..., :2] - self._centre[:2]
        least, most = local.min(axis=(0, 1)), local.max(axis=(0, 1))
        if low.any():
            least, most = np.full(2, -_ENDLESS), np.full(2, _ENDLESS)
        return 0.5 + 0.5 * np.concatenate([least / self._half_width - _SOFT, most / self._half_width + _SOFT])

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector, as placed last."""
        return self._rotation[:, 2]

    def occlude(
        self, ctx: moderngl.Context, draw_depth: Callable[[tuple[float, ...]], None], shadows: ShadowMaps
    ) -> None:
        """Look up from the floor, and spread what hangs low into a map of how much sky is left; mark the shadows."""
        top = self._half_width
        # height above the floor becomes depth; this mirrors the scene, so nothing is culled
        view = np.eye(4)
        view[:3, :3] = np.diag([1.0, 1.0, -1.0]) @ self._rotation.T
        view[:3, 3] = -view[:3, :3] @ (self.origin + self._rotation[:, :2] @ self._centre[:2])
        matrix = orthographic(self._half_width, top) @ view
        self._ceiling_target.use()
        ctx.disable(moderngl.CULL_FACE)
        ctx.enable(moderngl.DEPTH_TEST)
        self._ceiling_target.clear(depth=1.0)
        draw_depth(tuple(matrix.T.ravel()))
        self._openness_target.use()
        ctx.disable(moderngl.DEPTH_TEST)
        shadows.bind()
        self._ceiling.use(_CEILING_UNIT)
        self._occlude.program["extent"] = (2 * self._half_width, top, 0.35 * self._half_width)
        self._occlude.render(moderngl.TRIANGLES, vertices=3)
        self._openness.build_mipmaps()

    def bind(self) -> None:
        """Bind the occlusion map and the picture on the floor."""
        self._openness.use(3)
        if self._image is not None:
            self._image.use(5)
