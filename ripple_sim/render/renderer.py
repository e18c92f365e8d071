"""One frame: shadow map, floor occlusion, the solid scene, the floor, the backdrop, and the way back to memory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.gl import GLContext

from .bodies import Bodies, visible_geoms
from .camera import Pose, Viewpoint, perspective, view_matrix
from .color import SRGB8_ALPHA8
from .floor import Floor, find_floor
from .frame import FrameUniforms, light_studio
from .shadow import ShadowMap, to_unit
from .surface import Surface, SurfaceMesh

_NEAR, _FAR = 0.02, 200.0  # clip planes, in camera distances
_SHADOW_REACH = 2.5  # what is further from the focus, in camera distances, casts no shadow


class Renderer:
    """Draws a MuJoCo model and its rippled targets into RGB frames, headless.

    Parameters
    ----------
    gl : GLContext
    model : mujoco.MjModel
    targets : mapping
        Geom id to the surface that is drawn in place of the geom.
    width, height : int
        Frame size [pixels].
    samples : int
        Samples a pixel for smooth edges; at most what the driver has. 0 or 1: none.

    Raises
    ------
    RippleError
        If the driver cannot make frames of this size, or a look is unknown.
    """

    def __init__(
        self,
        gl: GLContext,
        model: Any,
        targets: Mapping[int, Surface],
        *,
        width: int,
        height: int,
        samples: int = 4,
    ) -> None:
        self.width, self.height = width, height
        self._gl, self._model = gl, model
        with gl as ctx:
            self._target, self._resolved = _framebuffers(ctx, width, height, samples)
            self._frame = FrameUniforms(ctx)
            self._shadow = ShadowMap(ctx)
            self._backdrop = ctx.vertex_array(gl.program("ripple_sim.render", "screen_vertex", "backdrop_fragment"), [])
            self._behind = ctx.texture((width, height), 4, internal_format=SRGB8_ALPHA8)
            self._behind.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self._behind.repeat_x = self._behind.repeat_y = False
            self._behind_target = ctx.framebuffer([self._behind])
            self._open_floor = ctx.texture((1, 1), 1, np.ones(1, dtype=np.float16).tobytes(), dtype="f2")
        self._targets = [SurfaceMesh(gl, geom, surface) for geom, surface in sorted(targets.items())]
        geoms = [geom for geom in visible_geoms(model) if geom not in targets]
        floor = find_floor(model, geoms)
        self._floor = None if floor is None else Floor(gl, model, floor)
        self._bodies = Bodies(gl, model, [geom for geom in geoms if geom != floor])
        self._pixels = bytearray(3 * width * height)

    def set_field(self, geom: int, field: NDArray[np.float32], limit: float) -> None:
        """Set the scalar field that a target with `field_colors` shows from now on.

        Parameters
        ----------
        geom : int
            Geom id of the target.
        field : float32 [6, N + 2, N + 2]
            Padded by a ring of neighbour texels, as a relief.
        limit : float
            The colours reach from -limit to limit.
        """
        with self._gl:
            next(target for target in self._targets if target.geom == geom).set_field(field, limit)

    def render(self, data: Any, reliefs: Mapping[int, NDArray[np.float32]], camera: Viewpoint) -> NDArray[np.uint8]:
        """Draw one frame.

        Parameters
        ----------
        data : mujoco.MjData
            Poses of the geoms, after `mj_forward` or `mj_step`.
        reliefs : mapping
            Geom id to relief, shape [6, N + 2, N + 2, 4]: gradient of the height (xyz, in the geom's frame) and height
            [m] (w), each face padded by a ring of neighbour texels. A target without one is flat.
        camera : Camera or FixedCamera

        Returns
        -------
        array of uint8, shape [height, width, 3]
            sRGB, top row first. A fresh array for every frame.
        """
        pose = camera.pose()
        with self._gl as ctx:
            light_view = self._update(ctx, data, reliefs, pose)
            self._draw_maps(ctx, light_view)
            self._draw_scene(ctx, pose)
            self._gl.wait()  # reading back would keep all other Python threads waiting for the driver, too
            ctx.copy_framebuffer(self._resolved, self._target)
            self._resolved.read_into(self._pixels, components=3, alignment=1)
        return np.frombuffer(self._pixels, dtype=np.uint8).reshape(self.height, self.width, 3)[::-1].copy()

    def _update(
        self, ctx: moderngl.Context, data: Any, reliefs: Mapping[int, NDArray[np.float32]], pose: Pose
    ) -> tuple[float, ...]:
        """Bring everything on the GPU up to date; return the light's matrix."""
        for target in self._targets:
            rotation = data.geom_xmat[target.geom].reshape(3, 3)
            target.update(ctx, rotation, data.geom_xpos[target.geom], reliefs.get(target.geom))
        self._bodies.update(data)

        frame = self._frame
        centre, radius = self._extent(data, pose)
        projection = perspective(pose.fovy, self.width / self.height, _NEAR * pose.distance, _FAR * pose.distance)
        self._view_projection = projection @ view_matrix(pose)
        frame.set_matrix("view_projection", self._view_projection)
        frame.set_vector("eye", pose.position, pose.distance)
        frame.set_vector("focus", pose.focus)
        if self._floor is not None:
            self._floor.place(frame, data, centre, radius)
        key = light_studio(frame, pose, None if self._floor is None else self._floor.albedo)
        light_view, width = self._shadow.fit(key, centre, radius)
        frame.set_matrix("shadow_matrix", to_unit(light_view))
        frame.set_vector("shadow_scale", self._shadow.scale(width))
        frame.set_vector("counts", [self._bodies.bind_occluders(data, pose.focus), 0, 0])
        frame.bind()
        return tuple(light_view.T.ravel())

    def _extent(self, data: Any, pose: Pose) -> tuple[NDArray[np.float64], float]:
        """Return centre and radius [m] of a ball about all that casts shadows near the camera's focus."""
        balls = [self._bodies.balls(data), *(target.ball() for target in self._targets)]
        centres, radii = np.concatenate([b[0] for b in balls]), np.concatenate([b[1] for b in balls])
        near = np.linalg.norm(centres - pose.focus, axis=1) < _SHADOW_REACH * pose.distance
        if not near.any():
            return pose.focus, pose.distance
        centres, radii = centres[near], radii[near, None]
        centre = ((centres - radii).min(axis=0) + (centres + radii).max(axis=0)) / 2
        return centre, float((np.linalg.norm(centres - centre, axis=1) + radii[:, 0]).max())

    def _draw_maps(self, ctx: moderngl.Context, light_view: tuple[float, ...]) -> None:
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._shadow.target.use()
        self._shadow.target.clear(depth=1.0)
        self._draw_depth(light_view)
        if self._floor is None:
            self._open_floor.use(3)
        else:
            self._floor.occlude(ctx, self._draw_depth)

    def _draw_depth(self, view_projection: tuple[float, ...]) -> None:
        for target in self._targets:
            target.draw_depth(view_projection)
        self._bodies.draw_depth(view_projection)

    def _draw_scene(self, ctx: moderngl.Context, pose: Pose) -> None:
        """Solids first and the floor and the backdrop behind them, so that no hidden pixel is shaded."""
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<="
        self._target.use()
        self._target.clear(depth=1.0)
        self._shadow.bind()
        for target in self._targets:
            if not target.clear:
                target.draw()
        self._bodies.draw()
        ctx.disable(moderngl.CULL_FACE)
        if self._floor is not None:
            self._floor.draw(pose.distance)
        self._backdrop.program["screen_to_world"] = tuple(np.linalg.inv(self._view_projection).T.ravel())
        self._backdrop.render(moderngl.TRIANGLES, vertices=3)
        ctx.enable(moderngl.CULL_FACE)
        self._draw_clear(ctx)
        ctx.enable(moderngl.BLEND)
        self._bodies.draw_transparent()
        ctx.disable(moderngl.BLEND)

    def _draw_clear(self, ctx: moderngl.Context) -> None:
        """Draw the targets through which the rest of the frame is seen."""
        clear = [target for target in self._targets if target.clear]
        if clear:
            ctx.copy_framebuffer(self._behind_target, self._target)
            self._behind.build_mipmaps()
            self._behind.use(6)
            self._target.use()
        for target in clear:
            target.draw()


def _framebuffers(
    ctx: moderngl.Context, width: int, height: int, samples: int
) -> tuple[moderngl.Framebuffer, moderngl.Framebuffer]:
    """Make the multisampled target and the one it is resolved into."""
    limit = int(ctx.info["GL_MAX_RENDERBUFFER_SIZE"])
    if not (1 <= width <= limit and 1 <= height <= limit):
        raise RippleError(
            f"frame size is {width}x{height} pixels; this driver makes 1 to {limit} along each side: "
            "choose a size within that"
        )
    samples = min(samples, ctx.max_samples) if samples > 1 else 0
    target = ctx.framebuffer(
        [ctx.renderbuffer((width, height), 4, samples=samples)],
        ctx.depth_renderbuffer((width, height), samples=samples),
    )
    return target, ctx.framebuffer([ctx.renderbuffer((width, height), 4)])
