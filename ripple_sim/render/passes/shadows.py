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

# Texels along a side of a map. A texel is about as wide as a pixel of the frame, where the casters
# fill the frame.
_MIN_SIZE = 512
_MAX_SIZE = 1536
_TEXELS_PER_PIXEL = 1.4
_SIZE_STEP = 256

# Width of the widest penumbra, as a share of the map's width.
_MAX_PENUMBRA = 0.15

# Widest field of view of a map of a near light [degrees].
_MAX_FOV = 130.0

# How far behind the casters shadows are drawn [radii of the ball about the casters].
_SHADOW_LENGTH = 30.0

# Edge of the square of shadow texels that a texel of the blockers stands for.
_TEXELS_PER_BLOCKER = 4

# Mipmap levels of the blockers: a texel of the last is as wide as twice the widest penumbra.
_BLOCKER_LEVELS = 7

# From clip coordinates, -1 to 1, to places in a shadow map, 0 to 1.
_CLIP_TO_MAP = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])

# A light within this many radii of the casters' centre takes the widest field of view.
_NEAR_CASTERS = 1.1

# The half angle of a near light's view is rounded up to multiples of 1/64 [rad], so that shadow
# edges do not crawl.
_HALF_ANGLE_STEPS = 64

# The near plane lies halfway between the light and the casters, but at least at this share of the
# far plane's distance.
_MIN_NEAR_SHARE = 0.004

# A view whose direction has at least this vertical part takes y in place of z as its upward helper.
_NEARLY_VERTICAL = 0.999


class ShadowMaps:
    """Square depth maps of the scene, seen from the lights, side by side in one texture.

    Parameters
    ----------
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    height : int
        Height of the frame [pixels].

    Attributes
    ----------
    size : int
        Texels along a side of a map.
    views : list
        A matrix from the world to clip coordinates for each light that casts shadows in this frame:
        16 numbers, column by column.
    """

    def __init__(self, resources: Resources, count: int, height: int) -> None:
        self._count = count
        steps = round(_TEXELS_PER_PIXEL * height / _SIZE_STEP)
        size = int(np.clip(_SIZE_STEP * steps, _MIN_SIZE, _MAX_SIZE))
        self.size = size
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
        """Aim the maps at a ball that contains all casters, and set the shadows of the frame.

        Parameters
        ----------
        centre : array, shape [3]
            Centre of the ball [m].
        radius : float
            Radius of the ball [m].

        Returns
        -------
        list of Light
            The lights that cast shadows, in the order of their maps.
        """
        casting = [light for light in lights if light.shadow][: self._count]
        self.views = []
        for shadow, light in zip(frame.values["shadows"], casting, strict=False):
            fit_light = _fit_far_light if light.position is None else _fit_near_light
            world_to_clip = fit_light(shadow, light, self.size, centre, radius)
            world_to_map = _CLIP_TO_MAP @ world_to_clip
            shadow["matrix"] = world_to_map.T  # column by column
            shadow["planes"] = np.linalg.inv(world_to_map)
            self.views.append(tuple(world_to_clip.T.ravel()))
        return casting

    def draw(self, cast: Callable[..., None]) -> None:
        """Draw all maps; `cast` is `DrawnScene.cast`."""
        for index, view in enumerate(self.views):
            self._target.viewport = (index * self.size, 0, self.size, self.size)
            self._target.use()
            if index == 0:
                self._target.clear(depth=1.0)
            cast(CasterMap.DEPTH, matrix=view)

    def find_blockers(self, ctx: moderngl.Context) -> None:
        """Filter the maps in advance for the search for blockers, which widen penumbras."""
        self._blockers_target.use()
        self._depth.use(Unit.SHADOW_MAPS)
        # without blending, which would add what the new texture holds by chance
        ctx.disable(moderngl.DEPTH_TEST | moderngl.BLEND)
        self._find_blockers.render(moderngl.TRIANGLES, vertices=3)
        ctx.enable(moderngl.DEPTH_TEST)
        self._blockers.build_mipmaps(max_level=_BLOCKER_LEVELS)

    def bind(self) -> None:
        """Bind the maps for the shaders, once with and once without the depth test."""
        self._depth.use(Unit.SHADOW_TEST)
        self._test.use(Unit.SHADOW_TEST)
        self._depth.use(Unit.SHADOW_MAPS)
        self._blockers.use(Unit.BLOCKERS)


def _fit_far_light(
    shadow: NDArray, light: Light, size: int, centre: NDArray, radius: float
) -> NDArray[np.float64]:
    """Fit the box of a far light's parallel rays to the ball, and set the shadow's uniforms.

    The box grows in coarse steps and moves by whole texels, so that shadow edges do not crawl. It
    extends behind the ball, where the shadows fall. Returns the matrix from the world to clip
    coordinates, shape [4, 4].
    """
    half_width = 2.0 ** (np.ceil(4 * np.log2(radius)) / 4)  # [m], in steps of a quarter octave
    texel = 2 * half_width / size  # [m]
    rotation = _axes(light.direction)
    eye = rotation @ centre
    eye[:2] = np.round(eye[:2] / texel) * texel
    eye[2] += half_width
    depth = (2 + _SHADOW_LENGTH) * half_width
    shadow["depth"] = depth, 0, 0, 1
    shadow["width"] = 2 * half_width, 0, size, 0
    shadow["penumbra"] = light.size, 0, _MAX_PENUMBRA, 0
    return orthographic(half_width, depth) @ view_along(rotation, eye)


def _fit_near_light(
    shadow: NDArray, light: Light, size: int, centre: NDArray, radius: float
) -> NDArray[np.float64]:
    """Fit a near light's view to the ball, no wider than its beam, and set the shadow's uniforms.

    Returns the matrix from the world to clip coordinates, shape [4, 4].
    """
    position: Any = light.position
    distance = float(np.linalg.norm(centre - position))  # [m]
    # backwards along the view
    towards = light.direction if distance < radius else (position - centre) / distance
    max_half_angle = np.radians(_MAX_FOV / 2)
    half_angle = max_half_angle
    if distance >= _NEAR_CASTERS * radius:
        half_angle = min(float(np.arcsin(radius / distance)), max_half_angle)
    if light.cutoff < half_angle:
        towards = light.direction
        half_angle = light.cutoff
    half_angle = np.ceil(half_angle * _HALF_ANGLE_STEPS) / _HALF_ANGLE_STEPS
    far = distance + _SHADOW_LENGTH * radius
    near = max(0.5 * (distance - radius), _MIN_NEAR_SHARE * far)
    shadow["depth"] = 0, near * far, near - far, far
    shadow["width"] = 0, 2 * np.tan(half_angle), size, 0
    shadow["penumbra"] = 0, light.size, _MAX_PENUMBRA, 0
    rotation = _axes(towards)
    projection = perspective(float(np.degrees(2 * half_angle)), 1.0, near, far)
    return projection @ view_along(rotation, rotation @ position)


def _axes(back: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right, up and back, the rows [3, 3], of a view along -back."""
    helper = [0.0, 0.0, 1.0] if abs(back[2]) < _NEARLY_VERTICAL else [0.0, 1.0, 0.0]
    right = np.cross(helper, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


class TransmissionMaps:
    """Square maps of the light that transparent objects let through, seen from the lights.

    The maps are in colour, side by side in one texture.

    Parameters
    ----------
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    size : int
        Texels along a side of a map.
    """

    def __init__(self, resources: Resources, count: int, size: int) -> None:
        self._size = size
        self._maps = resources.clamped_texture((count * size, size), 4, mipmaps=True, dtype="f2")
        self._target = resources.framebuffer(
            [self._maps], resources.depth_renderbuffer((count * size, size))
        )

    def draw(self, views: Sequence[tuple[float, ...]], cast: Callable[..., None]) -> None:
        """Draw all maps for `ShadowMaps.views`; `cast` is `DrawnScene.cast`."""
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
