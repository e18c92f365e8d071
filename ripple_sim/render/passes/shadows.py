"""Maps of the lights: shadow maps, and transmission maps of the transparent objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import CasterMap, Unit
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.projection import orthographic, perspective, view_along
from ripple_sim.render.resources import Resources
from ripple_sim.render.visuals.lights import Light

# Texels along a side: as many as make one about as wide as a pixel, where the casters fill the
# frame.
_LEAST = 512


_MOST = 1536


_PER_PIXEL = 1.4


_STEP = 256


_WIDEST = 0.15  # penumbra, as a share of the map


_STEEPEST_FOV = 130.0  # [degrees]


_REACH = 30.0  # how far behind the casters shadows fall, in radii of the casters' ball


_TEXELS_PER_BLOCKER = 4


_LEVELS = 7  # of mipmaps of the blockers: as wide as twice the widest penumbra


class ShadowMaps:
    """Square depth maps, side by side, of the scene as the lights see it.

    Parameters
    ----------
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    height : int
        Of the frame [pixels].

    Attributes
    ----------
    size : int
        Texels along a side.
    views : list
        Matrices of 16 numbers, column by column, of the lights that cast shadows in this frame.
    """

    def __init__(self, resources: Resources, count: int, height: int) -> None:
        self._count = count
        self.size = size = int(np.clip(_STEP * round(_PER_PIXEL * height / _STEP), _LEAST, _MOST))
        self.views: list[tuple[float, ...]] = []
        self._depth = resources.depth_texture((count * size, size))
        self._depth.compare_func = ""
        self._depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._target = resources.framebuffer(depth_attachment=self._depth)
        linear = moderngl.LINEAR, moderngl.LINEAR
        self._test = resources.sampler(
            texture=self._depth, compare_func="<=", filter=linear, repeat_x=False, repeat_y=False
        )
        blockers = count * size // _TEXELS_PER_BLOCKER, size // _TEXELS_PER_BLOCKER
        self._blockers = resources.clamped_texture(blockers, 4, mipmaps=True, dtype="f4")
        self._blockers_target = resources.framebuffer([self._blockers])
        self._find_blockers = resources.vertex_array(
            resources.program("passes/blockers", SHADOWS=count), []
        )

    def fit(
        self, frame: FrameUniforms, lights: list[Light], centre: NDArray, radius: float
    ) -> list[Light]:
        """Aim the maps at a ball [m] that contains all casters, set the frame's shadows, and return their lights."""
        casting = [light for light in lights if light.shadow][: self._count]
        self.views = []
        for shadow, light in zip(frame.values["shadows"], casting, strict=False):
            aim = _fit_far if light.position is None else _fit_near
            matrix = aim(shadow, light, self.size, centre, radius)
            to_map = (
                np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])
                @ matrix
            )
            shadow["matrix"] = to_map.T
            shadow["planes"] = np.linalg.inv(to_map)
            self.views.append(tuple(matrix.T.ravel()))
        return casting

    def draw(self, cast: Callable[..., None]) -> None:
        """Draw all maps, with the scene's `cast`."""
        for index, view in enumerate(self.views):
            self._target.viewport = (index * self.size, 0, self.size, self.size)
            self._target.use()
            if index == 0:
                self._target.clear(depth=1.0)
            cast(CasterMap.DEPTH, matrix=view)

    def find_blockers(self, ctx: moderngl.Context) -> None:
        """Prefilter the maps for the search for blockers."""
        self._blockers_target.use()
        self._depth.use(Unit.SHADOW_MAPS)
        ctx.disable(moderngl.DEPTH_TEST)
        self._find_blockers.render(moderngl.TRIANGLES, vertices=3)
        ctx.enable(moderngl.DEPTH_TEST)
        self._blockers.build_mipmaps(max_level=_LEVELS)

    def bind(self) -> None:
        """Bind the maps for the shaders, once with and once without the depth test."""
        self._depth.use(Unit.SHADOW_TEST)
        self._test.use(Unit.SHADOW_TEST)
        self._depth.use(Unit.SHADOW_MAPS)
        self._blockers.use(Unit.BLOCKERS)


def _fit_far(
    shadow: NDArray, light: Light, size: int, centre: NDArray, radius: float
) -> NDArray[np.float64]:
    """Fit a box to the ball; it grows in coarse steps and moves by whole texels, so that shadow edges do not crawl.

    It extends behind the ball, where the shadows fall.
    """
    half_width = 2.0 ** (np.ceil(4 * np.log2(radius)) / 4)
    texel = 2 * half_width / size
    rotation = _axes(light.direction)
    eye = rotation @ centre
    eye[:2] = np.round(eye[:2] / texel) * texel
    eye[2] += half_width
    depth = (2 + _REACH) * half_width
    shadow["depth"] = depth, 0, 0, 1
    shadow["width"] = 2 * half_width, 0, size, 0
    shadow["penumbra"] = light.size, 0, _WIDEST, 0
    return orthographic(half_width, depth) @ view_along(rotation, eye)


def _fit_near(
    shadow: NDArray, light: Light, size: int, centre: NDArray, radius: float
) -> NDArray[np.float64]:
    """Fit the light's view to the ball, no wider than its beam."""
    position: Any = light.position
    away = float(np.linalg.norm(centre - position))
    towards = light.direction if away < radius else (position - centre) / away
    widest = np.radians(_STEEPEST_FOV / 2)
    half = widest if away < 1.1 * radius else min(float(np.arcsin(radius / away)), widest)
    if light.cutoff < half:
        towards = light.direction
        half = light.cutoff
    half = np.ceil(half * 64) / 64
    far = away + _REACH * radius
    near = max(0.5 * (away - radius), 0.004 * far)
    shadow["depth"] = 0, near * far, near - far, far
    shadow["width"] = 0, 2 * np.tan(half), size, 0
    shadow["penumbra"] = 0, light.size, _WIDEST, 0
    rotation = _axes(towards)
    return perspective(float(np.degrees(2 * half)), 1.0, near, far) @ view_along(
        rotation, rotation @ position
    )


def _axes(back: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows right, up and back of a view along -back."""
    helper = [0.0, 0.0, 1.0] if abs(back[2]) < 0.999 else [0.0, 1.0, 0.0]
    right = np.cross(helper, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


class TransmissionMaps:
    """Square maps in colour, side by side, of the transparent objects of a scene as the lights see them.

    Parameters
    ----------
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    size : int
        Texels along a side.
    """

    def __init__(self, resources: Resources, count: int, size: int) -> None:
        self._size = size
        self._maps = resources.clamped_texture((count * size, size), 4, mipmaps=True, dtype="f2")
        self._target = resources.framebuffer(
            [self._maps], resources.depth_renderbuffer((count * size, size))
        )

    def draw(self, views: Sequence[tuple[float, ...]], cast: Callable[..., None]) -> None:
        """Draw all maps, of the lights' `ShadowMaps.views`, with the scene's `cast`."""
        self._target.viewport = (0, 0, *self._target.size)
        self._target.use()
        self._target.clear(depth=1.0)
        for light, view in enumerate(views):
            self._target.viewport = (light * self._size, 0, self._size, self._size)
            cast(CasterMap.TRANSMISSION, matrix=view, light=light)
        self._maps.build_mipmaps()

    def bind(self) -> None:
        """Bind the maps for the shaders."""
        self._maps.use(Unit.TRANSMISSION)
