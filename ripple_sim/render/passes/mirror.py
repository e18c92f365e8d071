"""What a reflecting floor shows: the scene as a camera under the floor sees it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose
from ripple_sim.render.gpu.frame_uniforms import FrameUniforms
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.solver.gl import GLContext

from .deferred import Picture
from .floor import Floor
from .screen_bounds import boxes_of

_UNIT = 14  # of the reflection's texture, in shaders/floor_fragment.glsl


class Mirror:
    """The reflection, at half the picture's resolution.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    size : (width, height)
        Of the picture [pixels].
    options : dict
        As for `Picture`.
    """

    def __init__(self, gl: GLContext, ctx: OwnedObjects, size: tuple[int, int], options: dict[str, int]) -> None:
        self._size = half = (max(size[0] // 2, 1), max(size[1] // 2, 1))
        self._aspect = size[0] / size[1]
        self._frame = FrameUniforms(ctx)
        self._picture = Picture(gl, ctx, half, samples=0, cut_out=False, floor=None, options=options)
        self._image = ctx.texture(half, 4, dtype=self._picture.dtype)
        self._image.repeat_x = self._image.repeat_y = False
        self._target = ctx.framebuffer([self._image])

    def draw(
        self,
        ctx: moderngl.Context,
        frame: FrameUniforms,
        pose: Pose,
        floor: Floor,
        balls: tuple[NDArray[np.float64], NDArray[np.float64]],
        draw_solids: Callable[[], None],
        bind_maps: Callable[[], None],
    ) -> None:
        """Draw the reflection of a frame whose uniforms are set; `frame` is bound again afterwards."""
        self._frame.values[...] = frame.values
        flip = np.eye(3) - 2 * np.outer(floor.normal, floor.normal)
        position = floor.origin + flip @ (pose.position - floor.origin)
        mirrored = dataclasses.replace(pose, position=position, rotation=flip @ pose.rotation)
        self._frame.set_camera(mirrored, self._aspect)
        self._frame.set_vector("floor_origin", floor.origin, 0.0)
        self._frame.bind()
        ctx.front_face = "cw"
        self._picture.begin(ctx)
        draw_solids()
        ctx.front_face = "ccw"
        bind_maps()
        self._picture.compose(ctx, boxes_of(*balls, mirrored, self._size))
        ctx.copy_framebuffer(self._target, self._picture.frame)
        frame.bind()

    def bind(self) -> None:
        """Bind the reflection for the floor's shader."""
        self._image.use(_UNIT)
