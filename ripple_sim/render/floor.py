"""The floor: an infinite plane that fades into the backdrop, with the soft darkness under whatever is near it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.gl import GLContext

from .bodies import color
from .camera import orthographic
from .color import linear, srgb_texture
from .frame import FrameUniforms

_PACKAGE = "ripple_sim.render"
_MAP_SIZE = 256
_REACH = 40.0  # half size of the drawn quad, in camera distances


def find_floor(model: Any, geoms: list[int]) -> int | None:
    """Return the plane that faces up most, or None."""
    rest = mujoco.MjData(model)
    mujoco.mj_kinematics(model, rest)
    planes = [geom for geom in geoms if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE]
    return max(planes, key=lambda geom: rest.geom_xmat[geom][8], default=None)


class Floor:
    """A model's floor plane."""

    def __init__(self, gl: GLContext, model: Any, geom: int) -> None:
        self.geom = geom
        self.albedo = color(model, geom)[:3]
        with gl as ctx:
            self._draw = ctx.vertex_array(gl.program(_PACKAGE, "floor_vertex", "floor_fragment"), [])
            self._occlude = ctx.vertex_array(gl.program(_PACKAGE, "screen_vertex", "floor_occlusion_fragment"), [])
            self._ceiling = ctx.depth_texture((_MAP_SIZE, _MAP_SIZE))
            self._ceiling.compare_func = ""
            self._ceiling.repeat_x = self._ceiling.repeat_y = False
            self._ceiling_target = ctx.framebuffer(depth_attachment=self._ceiling)
            self._openness = ctx.texture((_MAP_SIZE, _MAP_SIZE), 1, dtype="f2")
            self._openness.repeat_x = self._openness.repeat_y = False
            self._openness.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self._openness_target = ctx.framebuffer([self._openness])
            self._image, self._tiling = self._load_texture(ctx, model)

    def place(self, frame: FrameUniforms, data: Any, centre: NDArray, radius: float) -> None:
        """Set where the floor lies, and which part of it the occlusion map covers."""
        rotation = data.geom_xmat[self.geom].reshape(3, 3)
        self._origin, self._rotation = np.array(data.geom_xpos[self.geom]), rotation
        local = rotation.T @ (centre - self._origin)
        self._centre, self._half_width = local, 1.2 * radius
        frame.set_vector("floor_origin", self._origin, 1.0)
        frame.set_vector("floor_u", rotation[:, 0])
        frame.set_vector("floor_v", rotation[:, 1])
        frame.set_vector("floor_normal", rotation[:, 2])
        frame.set_vector("floor_albedo", self.albedo)
        frame.set_vector("floor_map", [local[0], local[1], self._half_width])

    def occlude(self, ctx: moderngl.Context, draw_depth: Callable[[tuple[float, ...]], None]) -> None:
        """Look up from the floor, and spread what hangs low into a map of how much sky is left."""
        top = self._half_width
        # height above the floor becomes depth; this mirrors the scene, so nothing is culled
        view = np.eye(4)
        view[:3, :3] = np.diag([1.0, 1.0, -1.0]) @ self._rotation.T
        view[:3, 3] = -view[:3, :3] @ (self._origin + self._rotation[:, :2] @ self._centre[:2])
        matrix = orthographic(self._half_width, top) @ view
        self._ceiling_target.use()
        ctx.disable(moderngl.CULL_FACE)
        ctx.enable(moderngl.DEPTH_TEST)
        self._ceiling_target.clear(depth=1.0)
        draw_depth(tuple(matrix.T.ravel()))
        self._openness_target.use()
        ctx.disable(moderngl.DEPTH_TEST)
        self._ceiling.use(2)
        self._occlude.program["extent"] = (2 * self._half_width, top, 0.35 * self._half_width)
        self._occlude.render(moderngl.TRIANGLES, vertices=3)
        self._openness.build_mipmaps()
        self._openness.use(3)

    def draw(self, distance: float) -> None:
        """Draw the floor; `distance` [m] is the camera's from its focus."""
        if self._image is not None:
            self._image.use(5)
        self._draw.program["tiling"] = (*self._tiling, float(self._image is not None), 0.0)
        self._draw.program["reach"] = _REACH * distance
        self._draw.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _load_texture(self, ctx: moderngl.Context, model: Any) -> tuple[moderngl.Texture | None, NDArray]:
        """Return the material's picture and its repetitions a metre."""
        material = model.geom_matid[self.geom]
        texture = -1 if material < 0 else int(model.mat_texid[material].max())
        if texture < 0 or model.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_2D:
            return None, np.ones(2)
        height, width, channels = (int(n[texture]) for n in (model.tex_height, model.tex_width, model.tex_nchannel))
        start = model.tex_adr[texture]
        pixels = np.asarray(model.tex_data[start : start + height * width * channels]).reshape(height, width, channels)
        pixels = np.repeat(pixels, 3, axis=2) if channels < 3 else pixels[..., :3]
        tint = self.albedo
        self.albedo = tint * linear(pixels / 255.0).mean(axis=(0, 1))
        repeat = np.asarray(model.mat_texrepeat[material], dtype=np.float64)
        size = 2 * np.asarray(model.geom_size[self.geom][:2])
        if not model.mat_texuniform[material]:
            repeat = repeat / np.where(size > 0, size, 2.0)
        return srgb_texture(ctx, pixels.astype(np.uint8)), repeat
