"""The key light's shadow map."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from .camera import orthographic

_SIZE = 2048


class ShadowMap:
    """A square depth map of the scene as the key light sees it."""

    def __init__(self, ctx: moderngl.Context) -> None:
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

    def fit(self, key: NDArray, centre: NDArray, radius: float) -> tuple[NDArray[np.float64], float]:
        """World to clip matrix of the light for a ball that holds all casters, and the map's width [m].

        The box grows in coarse steps and moves by whole texels, so that shadow edges do not crawl. It reaches behind
        the ball, where the shadows fall.
        """
        half_width = 2.0 ** (np.ceil(4 * np.log2(radius)) / 4)
        texel = 2 * half_width / _SIZE
        right = np.cross([0.0, 0.0, 1.0], key)
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(key, right), key])
        eye = rotation @ centre
        eye[:2] = np.round(eye[:2] / texel) * texel
        eye[2] += half_width
        view = np.eye(4)
        view[:3, :3] = rotation
        view[:3, 3] = -eye
        return orthographic(half_width, 4 * half_width) @ view, 2 * half_width

    def scale(self, width: float) -> tuple[float, float, float]:
        """Width, depth and texel of the map [m]."""
        return width, 2 * width, width / _SIZE

    def bind(self) -> None:
        """Bind the map for the shaders, once with and once without the depth test."""
        self._depth.use(1)
        self._test.use(1)
        self._depth.use(2)


def to_unit(view_projection: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn clip coordinates -1 to 1 into texture coordinates 0 to 1."""
    return np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]]) @ view_projection
