"""`SceneLight`: the light and the background of a frame, from a model, a scene or the studio."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import MAX_LIGHTS, MAX_SHADOWS, Unit
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.pose import Pose
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.solver.errors import RippleError

from .lights import LIGHT_KIND, UNLIT_AMBIENT, Light, Lighting, model_lighting, scene_lighting
from .objects import Assets
from .studio import (
    BESIDE_LIGHTS,
    FADE,
    SOFT_BOX_LIGHTS,
    STUDIO_FADE,
    direction,
    sky_colors,
    studio_lighting,
)
from .surroundings import RenderFlags, set_surroundings

LIGHTING = ("auto", "model", "studio")
_AS_USUAL = RenderFlags()


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
        normal = direction(pose, box.azimuth, box.elevation)
        across = np.cross([0.0, 0.0, 1.0], normal)
        tangent = across / np.linalg.norm(across)
        frame.values["soft_box_normal"][index] = [*normal, box.half_width]
        frame.values["soft_box_tangent"][index] = [
            *tangent / np.linalg.norm(tangent),
            box.half_height,
        ]
        frame.values["soft_box_radiance"][index][:3] = boxes * np.array(box.radiance)
    horizon, zenith, light_above = sky_colors(lighting, pose, floor_albedo, sky)
    frame.set_vector("horizon", horizon)
    frame.set_vector("zenith", zenith)
    frame.set_vector("sky", light_above, 1.0 if lighting.studio else 0.0)
    if lighting.backdrop:
        frame.set_vector("floor_fade", [*(STUDIO_FADE if lighting.studio else FADE), 0.0])


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
        cast = np.count_nonzero(casting.astype(bool) & (kinds != LIGHT_KIND.mjLIGHT_IMAGE))
        needed = {
            "NEAR_LIGHTS": int((kinds != LIGHT_KIND.mjLIGHT_DIRECTIONAL).any()),
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
                    lighting, ambient=np.full(3, srgb_to_linear(UNLIT_AMBIENT))
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
