"""The reflection in the floor: the scene as a camera below the floor sees it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import moderngl
import numpy as np

from ripple_sim.render.bounds import Balls
from ripple_sim.render.camera import Pose
from ripple_sim.render.contract import Unit
from ripple_sim.render.frame_format import FrameFormat
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.resources import Resources

from .deferred import DeferredShading
from .floor import Floor
from .screen_bounds import boxes_of


class Mirror:
    """The reflection, at half the frame's resolution.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
        Of the frame.
    floor : Floor
    light_options : mapping
        As for `DeferredShading`.
    """

    def __init__(
        self, resources: Resources, frame_format: FrameFormat, floor: Floor, light_options: Mapping[str, int]
    ) -> None:
        self._floor, self._aspect = floor, frame_format.aspect
        width, height = frame_format.size
        half = dataclasses.replace(frame_format, size=(max(width // 2, 1), max(height // 2, 1)))
        self._size = half.size
        self._frame = FrameUniforms(resources)
        self._shading = DeferredShading(resources, half, None, light_options)
        self._image = resources.texture(half.size, 4, dtype=half.dtype)
        self._image.repeat_x = self._image.repeat_y = False
        self._framebuffer = resources.framebuffer([self._image])

    def draw(
        self,
        ctx: moderngl.Context,
        frame: FrameUniforms,
        pose: Pose,
        balls: Balls,
        draw_solids: Callable[[], None],
        bind_maps: Callable[[], None],
    ) -> None:
        """Draw the reflection for a frame whose uniforms are set; `frame` is bound again afterwards.

        Parameters
        ----------
        ctx : moderngl.Context
        frame : FrameUniforms
        pose : Pose
            Of the camera above the floor.
        balls : Balls
            That contain all solids.
        draw_solids, bind_maps : callable
            Draw the solids into the G-buffer; bind what shading needs.
        """
        self._frame.values[...] = frame.values
        floor = self._floor
        flip = np.eye(3) - 2 * np.outer(floor.normal, floor.normal)
        position = floor.origin + flip @ (pose.position - floor.origin)
        mirrored = dataclasses.replace(pose, position=position, rotation=flip @ pose.rotation)
        self._frame.set_camera(mirrored, self._aspect)
        self._frame.set_vector("floor_origin", floor.origin, 0.0)
        self._frame.bind()
        ctx.front_face = "cw"
        self._shading.clear(ctx)
        self._shading.begin(ctx)
        draw_solids()
        ctx.front_face = "ccw"
        bind_maps()
        self._shading.shade(ctx, boxes_of(balls, mirrored, self._size))
        ctx.copy_framebuffer(self._framebuffer, self._shading.frame)
        frame.bind()

    def bind(self) -> None:
        """Bind the reflection for the floor's shader."""
        self._image.use(Unit.MIRROR)
