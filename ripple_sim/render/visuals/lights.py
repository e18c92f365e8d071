"""The light of a scene: the lights and the skybox of the MJCF, or a photo studio in their place.

Lights of the MJCF are converted from MuJoCo's light in sRGB to linear light. The studio has a key
light, soft boxes and a backdrop; it stands in where the MJCF has no lights.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.render.contract import MAX_LIGHTS, MAX_SHADOWS, Unit
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.pose import Pose
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.solver.errors import RippleError

from .objects import Assets
from .surroundings import RenderFlags, set_surroundings

_KIND = mujoco.mjtLightType
_SUN_TANGENT = 0.05  # of the angular radius of a directional light, which MJCF does not give
_UNLIT_AMBIENT = 0.3  # ambient light in sRGB where there is no light at all, as in MuJoCo
_GAMMA = 2.2  # of sRGB, about: factor of a beam's exponent from sRGB to linear light

# Sum of all lights in sRGB above which they are dimmed, as MuJoCo's frames saturate.
_MAX_BRIGHTNESS = 1.3

# Key light of the studio.
_KEY_RADIANCE = np.array([1.34, 1.28, 1.19])  # linear, of a white surface that faces it
_KEY_TANGENT = 0.10  # of its angular radius
_KEY_AZIMUTH = 92.0  # from the camera's forward axis, left is positive [degrees]
_KEY_ELEVATION = 44.0  # [degrees]

# Soft boxes: azimuth from the camera's forward axis (left is positive) and elevation [degrees],
# half width and half height over distance, radiance.
SOFT_BOX_LIGHTS = (
    (100.0, 46.0, 0.26, 0.34, (7.5, 7.2, 6.8)),
    (-68.0, 28.0, 0.16, 0.75, (4.2, 4.7, 5.4)),
    (10.0, 66.0, 0.65, 0.20, (3.6, 3.7, 3.8)),
)
BESIDE_LIGHTS = 0.5  # brightness of the soft boxes' reflections beside lights of the MJCF
_MAX_FLOOR_TINT = 0.6  # share of the floor's colour that the background takes on, at most

# Where the floor begins to fade into the background and where it ends, in distances of the focus.
STUDIO_FADE = (0.4, 3.4)
FADE = (1.5, 10.0)

LIGHTING = ("auto", "model", "studio")
_AS_USUAL = RenderFlags()


@dataclass(frozen=True)
class Light:
    """A light.

    Attributes
    ----------
    direction : array, shape [3]
        Unit vector towards a light that is far away, against the beam of one at a position.
    radiance : array, shape [3]
        Linear; of a white surface facing the light.
    position : array, shape [3], optional
        [m]; None: far away.
    size : float
        Tangent of its angular radius if it is far away, or its radius [m].
    cutoff : float
        Half angle of the beam [radians].
    exponent : float
        Of the cosine with which the beam falls off.
    falloff : array, shape [3]
        Constant, linear [1/m] and quadratic [1/m^2] attenuation.
    gloss : float
        Share of its radiance that highlights have.
    shadow : bool
    """

    direction: NDArray[np.float64]
    radiance: NDArray[np.float64]
    position: NDArray[np.float64] | None = None
    size: float = _SUN_TANGENT
    cutoff: float = np.pi
    exponent: float = 0.0
    falloff: NDArray[np.float64] = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    gloss: float = 1.0
    shadow: bool = False

    def is_below(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> bool:
        """Whether the light shines from behind a plane, given by a point and its normal."""
        towards = self.direction if self.position is None else self.position - point
        return bool(towards @ normal < 0.0)

    def at(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch, shape [3]."""
        towards = self.direction
        strength = 1.0
        if self.position is not None:
            offset = self.position - point
            distance = max(float(np.linalg.norm(offset)), 1e-9)
            towards = offset / distance
            along = float(towards @ self.direction)
            beam = max(along, 0.0) ** self.exponent if along >= np.cos(self.cutoff) else 0.0
            strength = beam / float(self.falloff @ [1.0, distance, distance**2])
        return self.radiance * strength * max(float(towards @ normal), 0.0)


@dataclass(frozen=True)
class Lighting:
    """All light of a frame: the lights, of which the first may cast shadows, and the ambient light.

    `ambient` is the radiance from all around, shape [3]; with `studio` the studio replaces the
    MJCF's lights. Without a `backdrop` nothing is around the scene but a skybox, as in MuJoCo.
    """

    lights: list[Light]
    ambient: NDArray[np.float64]
    studio: bool
    backdrop: bool = True

    def on(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch by all lights, shape [3]."""
        return sum((light.at(point, normal) for light in self.lights), np.zeros(3))


def in_studio(model: Any, lighting: str) -> bool:
    """Whether the studio replaces the MJCF's lights, see `SceneLight`."""
    return lighting == "studio" or (lighting == "auto" and not model.nlight)


def lighting_of(
    model: Any,
    data: Any,
    pose: Pose,
    lighting: str,
    lights: Sequence[mujoco.MjvLight] | None = None,
) -> Lighting:
    """All light of a frame, as the renderer has it; see `SceneLight`.

    A scene's `lights` replace those of the model.
    """
    if in_studio(model, lighting):
        return studio_lighting(pose)
    return model_lighting(model, data, pose) if lights is None else scene_lighting(lights)


def model_lighting(model: Any, data: Any, pose: Pose) -> Lighting:
    """Lights of the MJCF as posed in `data`, and the headlight.

    MuJoCo adds light up in sRGB and cuts off at 1. Here it adds up in linear light, scaled such
    that a surface comes out as in MuJoCo both where it faces all lights and where it faces none.
    """
    head = model.vis.headlight
    ambient = np.zeros(3)
    lights = []
    if head.active:
        ambient += head.ambient
        radiance = np.array(head.diffuse, dtype=np.float64)
        lights.append(
            Light(direction=pose.rotation[:, 2], radiance=radiance, gloss=_gloss(head.specular))
        )
    for index in range(model.nlight):
        if model.light_active[index] and model.light_type[index] != _KIND.mjLIGHT_IMAGE:
            ambient += model.light_ambient[index]
            lights.append(_light(model, data, index))
    return _in_linear_light(lights, ambient)


def scene_lighting(lights: Sequence[mujoco.MjvLight]) -> Lighting:
    """Lights as a scene of MuJoCo's has them, the headlight too; see `model_lighting`."""
    ambient = np.zeros(3)
    lamps = []
    for light in lights:
        if light.type != _KIND.mjLIGHT_IMAGE:
            ambient += light.ambient
            lamps.append(_scene_light(light))
    return _in_linear_light(lamps, ambient if len(lights) else np.full(3, _UNLIT_AMBIENT))


def _in_linear_light(lights: list[Light], ambient: NDArray[np.float64]) -> Lighting:
    """Convert lights and ambient light from MuJoCo's, which add up in sRGB, to linear light."""
    lights = [light for light in lights if light.radiance.any()]
    # lights that cast shadows come before the others, the brightest first
    lights.sort(key=lambda light: (not light.shadow, -light.radiance.sum()))
    lights = lights[:MAX_LIGHTS]
    total = sum((light.radiance for light in lights), np.zeros(3)).max()
    base = srgb_to_linear(ambient.max())
    scale = 0.0
    if total > 0:
        brightest = srgb_to_linear(min(ambient.max() + total, _MAX_BRIGHTNESS))
        scale = (brightest - base) / total
    lights = [
        dataclasses.replace(light, radiance=max(scale, 0.0) * light.radiance) for light in lights
    ]
    return Lighting(lights, srgb_to_linear(ambient), studio=False)


def _gloss(specular: ArrayLike) -> float:
    """Share of a light's radiance that its highlights have, by MuJoCo's specular colour.

    From 0.3 on, the default of a lamp, highlights are physical: the share is 1.
    """
    return min(float(srgb_to_linear(np.max(specular)) / srgb_to_linear(0.3)), 1.0)


def _light(model: Any, data: Any, index: int) -> Light:
    """A light of the MJCF, with its radiance in sRGB."""
    directional = model.light_type[index] == _KIND.mjLIGHT_DIRECTIONAL
    spot = model.light_type[index] == _KIND.mjLIGHT_SPOT
    return Light(
        direction=-np.array(data.light_xdir[index]),
        radiance=np.array(model.light_diffuse[index], dtype=np.float64),
        position=None if directional else np.array(data.light_xpos[index]),
        size=_SUN_TANGENT if directional else float(model.light_bulbradius[index]),
        cutoff=np.radians(min(float(model.light_cutoff[index]), 180.0)) if spot else np.pi,
        exponent=_GAMMA * float(model.light_exponent[index]) if spot else 0.0,
        falloff=np.array(model.light_attenuation[index], dtype=np.float64),
        gloss=_gloss(model.light_specular[index]),
        shadow=bool(model.light_castshadow[index]),
    )


def _scene_light(light: mujoco.MjvLight) -> Light:
    """A light of a scene, with its radiance in sRGB."""
    directional = light.type == _KIND.mjLIGHT_DIRECTIONAL
    spot = light.type == _KIND.mjLIGHT_SPOT
    direction = np.array(light.dir, dtype=np.float64)
    return Light(
        direction=-direction / max(float(np.linalg.norm(direction)), 1e-9),
        radiance=np.array(light.diffuse, dtype=np.float64),
        position=None if directional else np.array(light.pos, dtype=np.float64),
        size=_SUN_TANGENT if directional else float(light.bulbradius),
        cutoff=np.radians(min(float(light.cutoff), 180.0)) if spot else np.pi,
        exponent=_GAMMA * float(light.exponent) if spot else 0.0,
        falloff=np.array(light.attenuation if spot else [1.0, 0.0, 0.0], dtype=np.float64),
        gloss=_gloss(light.specular),
        shadow=bool(light.castshadow),
    )


def studio_lighting(pose: Pose) -> Lighting:
    """One key light that turns with the camera, so that ripples look alike from all sides."""
    key = Light(
        _direction(pose, _KEY_AZIMUTH, _KEY_ELEVATION),
        _KEY_RADIANCE,
        size=_KEY_TANGENT,
        shadow=True,
    )
    return Lighting([key], np.zeros(3), studio=True)


def sky_colors(
    lighting: Lighting, pose: Pose, floor_albedo: NDArray | None, sky: NDArray | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Linear colours [3] of the background at the horizon and overhead, and radiance of the sky.

    The radiance of the sky lights surfaces that face it. Parameters as for `set_lighting`.
    """
    if not lighting.backdrop:
        return np.zeros(3), np.zeros(3), lighting.ambient
    tint = np.array([0.40, 0.42, 0.46])
    if floor_albedo is not None:
        # irradiance over pi of the floor far away, by the lights that reach it
        irradiances = [
            light.at(pose.focus, np.array([0.0, 0.0, 1.0]))
            for light in lighting.lights
            if light.position is None
        ]
        far = np.minimum(sum(irradiances, lighting.ambient), _MAX_FLOOR_TINT)
        tint = (_MAX_FLOOR_TINT if lighting.studio else far) * floor_albedo
    zenith = tint * np.array([0.36, 0.40, 0.48])
    if lighting.studio:
        return tint, zenith, 0.75 * (0.7 * tint + 0.3 * zenith)
    hue = np.ones(3) if sky is None else sky / max(sky.mean(), 1e-6)
    return tint, zenith, lighting.ambient * (0.5 + 0.5 * hue)


def set_lighting(
    frame: FrameUniforms,
    lighting: Lighting,
    pose: Pose,
    floor_albedo: NDArray | None,
    sky: NDArray | None,
) -> None:
    """Set the frame's lights and soft boxes, and colour its background.

    Parameters
    ----------
    floor_albedo : array, optional
        Linear colour of the floor; tints the background, so that one fades into the other.
    sky : array, optional
        Mean linear colour of a skybox.
    """
    boxes = np.full(3, 1.0 if lighting.studio else BESIDE_LIGHTS)
    # without a backdrop the reflections of the soft boxes have the brightness and hue of the lamps
    if not lighting.backdrop:
        total = sum((light.radiance for light in lighting.lights), lighting.ambient)
        boxes = boxes * np.minimum(total, 1.0)
    frame.values["lights"] = 0  # where there are fewer, the others are dark
    for record, light in zip(frame.values["lights"], lighting.lights, strict=False):
        record["position"] = [0, 0, 0, 0] if light.position is None else [*light.position, 1]
        record["direction"] = [*light.direction, np.cos(light.cutoff)]
        record["radiance"] = [*light.radiance, light.exponent]
        record["falloff"] = [*light.falloff, light.gloss]
    # the soft boxes turn with the camera
    for index, box in enumerate(SOFT_BOX_LIGHTS):
        azimuth, elevation, half_width, half_height, brightness = box
        normal = _direction(pose, azimuth, elevation)
        tangent = np.cross([0.0, 0.0, 1.0], normal)
        frame.values["soft_box_normal"][index] = [*normal, half_width]
        frame.values["soft_box_tangent"][index] = [*tangent / np.linalg.norm(tangent), half_height]
        frame.values["soft_box_radiance"][index][:3] = boxes * np.array(brightness)
    horizon, zenith, light_above = sky_colors(lighting, pose, floor_albedo, sky)
    frame.set_vector("horizon", horizon)
    frame.set_vector("zenith", zenith)
    frame.set_vector("sky", light_above, 1.0 if lighting.studio else 0.0)
    if lighting.backdrop:
        frame.set_vector("floor_fade", [*(STUDIO_FADE if lighting.studio else FADE), 0.0])


def _direction(pose: Pose, azimuth: float, elevation: float) -> NDArray[np.float64]:
    """Unit vector in the world, by azimuth and elevation [degrees] from the camera's heading."""
    right = pose.rotation[:, 0]
    right = np.array([right[0], right[1], 0.0]) / max(np.hypot(right[0], right[1]), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    turn, rise = np.radians([azimuth, elevation])
    flat = np.cos(turn) * forward - np.sin(turn) * right
    return np.cos(rise) * flat + np.sin(rise) * np.array([0.0, 0.0, 1.0])


class SceneLight:
    """The lights and the background of a model.

    Parameters
    ----------
    lighting : str
        One of `LIGHTING`; "auto": the studio where the MJCF has no light.
    backdrop : bool
        Whether the floor fades into a backdrop, or into the horizon of the skybox. Otherwise what
        is around the scene is as in MuJoCo: black, or the skybox, with fog and haze. The studio
        always has its backdrop.

    Attributes
    ----------
    studio : bool
        Whether the studio replaces all lights.
    options : dict
        Defines for the shaders, see `DeferredShading`: BACKDROP, SKYBOX, HORIZON, NEAR_LIGHTS,
        LIGHTS and SHADOWS.

    Raises
    ------
    RippleError
        If the lighting is unknown.
    """

    def __init__(self, assets: Assets, lighting: str, backdrop: bool = True) -> None:
        if lighting not in LIGHTING:
            raise RippleError(
                f"lighting must be one of {', '.join(map(repr, LIGHTING))}, got {lighting!r}"
            )
        self._model = model = assets.model
        self._lighting = lighting
        studio = in_studio(model, lighting)
        self._sky = None if studio else assets.skybox()
        self._backdrop = backdrop or studio
        self.studio = studio
        self.options = {
            "BACKDROP": int(self._backdrop),
            "SKYBOX": int(self._sky is not None),
            "HORIZON": int(self._sky is not None and self._sky.horizon is not None),
            "NEAR_LIGHTS": 0,
            "LIGHTS": 1,
            "SHADOWS": 1,
        }
        self.make_room(None)

    def make_room(self, lights: Sequence[mujoco.MjvLight] | None) -> None:
        """Make the options allow the lights of a scene, or the present lights of the model."""
        if self.studio:
            return
        if lights is None:
            kinds = self._model.light_type
            casting = self._model.light_castshadow
        else:
            pairs = np.array([(light.type, light.castshadow) for light in lights])
            kinds, casting = pairs.reshape(-1, 2).T
        cast = np.count_nonzero(casting.astype(bool) & (kinds != _KIND.mjLIGHT_IMAGE))
        needed = {
            "NEAR_LIGHTS": int((kinds != _KIND.mjLIGHT_DIRECTIONAL).any()),
            "LIGHTS": min(len(kinds) + 1, MAX_LIGHTS),  # with the headlight
            "SHADOWS": min(int(cast), MAX_SHADOWS),
        }
        for name, count in needed.items():
            self.options[name] = max(self.options[name], count)

    def set(
        self,
        frame: FrameUniforms,
        data: Any,
        pose: Pose,
        floor_albedo: NDArray | None = None,
        floor_normal: NDArray | None = None,
        lights: Sequence[mujoco.MjvLight] | None = None,
        *,
        flags: RenderFlags = _AS_USUAL,
        ground: NDArray | None = None,
    ) -> list[Light]:
        """Set the frame's light and background; return the lights.

        Parameters
        ----------
        floor_albedo, floor_normal : array, shape [3], optional
            Colour and normal of the floor.
        lights : sequence of mujoco.MjvLight, optional
            Of a scene; they replace the model's.
        ground : array, shape [3], optional
            A point of the floor [m], if it is an infinite plane that is seen from above. Lamps
            below the floor that cast shadows then light nothing.
        """
        lighting = lighting_of(self._model, data, pose, self._lighting, lights)
        shining = lighting.lights
        if not flags.shadow:
            shining = [dataclasses.replace(light, shadow=False) for light in shining]
        lighting = dataclasses.replace(lighting, lights=shining, backdrop=self._backdrop)
        if not self._backdrop:
            if ground is not None and floor_normal is not None:
                above = [
                    light
                    for light in shining
                    if not (light.shadow and light.is_below(ground, floor_normal))
                ]
                lighting = dataclasses.replace(lighting, lights=above)
            if lights is None and not (
                self._model.vis.headlight.active or self._model.light_active.any()
            ):
                lighting = dataclasses.replace(
                    lighting, ambient=np.full(3, srgb_to_linear(_UNLIT_AMBIENT))
                )
            sky = self._sky is not None
            set_surroundings(
                frame, self._model, pose, flags, skybox=sky, endless=ground is not None
            )
        set_lighting(
            frame, lighting, pose, floor_albedo, None if self._sky is None else self._sky.mean
        )
        if floor_normal is not None:
            frame.set_vector("floor_light", lighting.on(pose.focus, floor_normal))
        return lighting.lights

    def bind(self) -> None:
        """Bind the skybox."""
        if self._sky is not None:
            self._sky.cube.use(Unit.SKYBOX)
            if self._sky.horizon is not None:
                self._sky.horizon.use(Unit.HORIZON)
