"""The first light's shadow map."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from .camera import orthographic, perspective
from .frame import FrameUniforms
from .lights import Light
from .owned import OwnedObjects

_SIZE = 1536
_WIDEST = 0.022  # penumbra, as a share of the map
_STEEPEST_FOV = 130.0  # [degrees]


class ShadowMap:
    """A square depth map of the scene as a lamp sees it."""

    def __init__(self, ctx: OwnedObjects) -> None:
        self._depth = ctx.depth_texture((_SIZE, _SIZE))
        self._depth.compare_func = ""
        self._depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.target = ctx.framebuffer(depth_attachment=self._depth)
        self._test = ctx.sampler(
            texture=self._depth,
            compare_func="<=",
            filter=(moderngl.LINEAR, moderngl.LINEAR),
            repeat_x=False,
            repeat_y=False,
        )

    def fit(self, frame: FrameUniforms, light: Light, centre: NDArray, radius: float) -> NDArray[np.float64]:
        """Aim the map at a ball [m] that holds all casters; fill the frame's shadow and return the light's matrix."""
        aim = self._fit_far if light.position is None else self._fit_near
        matrix = aim(frame, light, centre, radius)
        to_map = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]]) @ matrix
        frame.set_matrix("shadow_matrix", to_map)
        frame.set_matrix("shadow_planes", np.linalg.inv(to_map).T)
        return matrix

    def _fit_far(self, frame: FrameUniforms, light: Light, centre: NDArray, radius: float) -> NDArray[np.float64]:
        """Cover the ball by a box that grows in coarse steps and moves by whole texels: shadow edges do not crawl.

        It reaches behind the ball, where the shadows fall.
        """
        half_width = 2.0 ** (np.ceil(4 * np.log2(radius)) / 4)
        texel = 2 * half_width / _SIZE
        rotation = _axes(light.direction)
        eye = rotation @ centre
        eye[:2] = np.round(eye[:2] / texel) * texel
        eye[2] += half_width
        depth = 4 * half_width
        frame.set_vector("shadow_depth", [depth, 0, 0], 1)
        frame.set_vector("shadow_width", [2 * half_width, 0, _SIZE])
        frame.set_vector("shadow_penumbra", [light.size, 0, _WIDEST])
        return orthographic(half_width, depth) @ _view(rotation, eye)

    def _fit_near(self, frame: FrameUniforms, light: Light, centre: NDArray, radius: float) -> NDArray[np.float64]:
        """Cover the ball by the lamp's view of it, no wider than its beam."""
        position: Any = light.position
        away = float(np.linalg.norm(centre - position))
        towards = light.direction if away < radius else (position - centre) / away
        widest = np.radians(_STEEPEST_FOV / 2)
        half = widest if away < 1.1 * radius else min(float(np.arcsin(radius / away)), widest)
        half = np.ceil(half * 64) / 64
        far = away + 4 * radius
        near = max(0.5 * (away - radius), 0.004 * far)
        frame.set_vector("shadow_depth", [0, near * far, near - far], far)
        frame.set_vector("shadow_width", [0, 2 * np.tan(half), _SIZE])
        frame.set_vector("shadow_penumbra", [0, light.size, _WIDEST])
        rotation = _axes(towards)
        return perspective(float(np.degrees(2 * half)), 1.0, near, far) @ _view(rotation, rotation @ position)

    def bind(self) -> None:
        """Bind the map for the shaders, once with and once without the depth test."""
        self._depth.use(1)
        self._test.use(1)
        self._depth.use(2)


def _axes(back: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows right, up and back of a view along -back."""
    helper = [0.0, 0.0, 1.0] if abs(back[2]) < 0.999 else [0.0, 1.0, 0.0]
    right = np.cross(helper, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


def _view(rotation: NDArray[np.float64], eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """World to eye coordinates; `eye` is the eye's place along the rows of `rotation`."""
    view = np.eye(4)
    view[:3, :3] = rotation
    view[:3, 3] = -eye
    return view
