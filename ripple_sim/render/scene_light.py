"""The light of a scene: the lights and the skybox of the MJCF, or the studio."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.passes.floor import Floor
from ripple_sim.render.visuals.assets import Assets
from ripple_sim.render.visuals.lights import (
    Light,
    Lighting,
    count_casting_lights,
    count_lights,
    has_near_lights,
    is_lit,
    model_lighting,
)
from ripple_sim.render.visuals.studio import set_lighting, studio_lighting
from ripple_sim.solver.errors import RippleError

from .camera import Pose
from .contract import Unit
from .frame_uniforms import FrameUniforms

LIGHTING = ("auto", "model", "studio")


class SceneLight:
    """What lights a model.

    Parameters
    ----------
    assets : Assets
    lighting : str
        One of `LIGHTING`; "auto": the studio where the MJCF has no light.

    Attributes
    ----------
    shadows : int
        How many lights may cast shadows.

    Raises
    ------
    RippleError
        If the lighting is unknown.
    """

    def __init__(self, assets: Assets, lighting: str) -> None:
        if lighting not in LIGHTING:
            raise RippleError(f"lighting is {lighting!r}; valid are {', '.join(map(repr, LIGHTING))}")
        self._model = model = assets.model
        self._studio = lighting == "studio" or (lighting == "auto" and not is_lit(model))
        self.shadows = 1 if self._studio else count_casting_lights(model)
        self._sky = None if self._studio else assets.textures.skybox()

    @property
    def options(self) -> dict[str, int]:
        """Defines for the shaders; see `DeferredShading`."""
        return {
            "SKYBOX": int(self._sky is not None),
            "NEAR_LIGHTS": int(not self._studio and has_near_lights(self._model)),
            "LIGHTS": 1 if self._studio else count_lights(self._model),
            "SHADOWS": self.shadows,
        }

    def set(self, frame: FrameUniforms, data: Any, pose: Pose, floor: Floor | None) -> list[Light]:
        """Set the frame's light and background; return the lights."""
        lighting: Lighting = studio_lighting(pose) if self._studio else model_lighting(self._model, data, pose)
        mean: NDArray[np.float64] | None = None if self._sky is None else self._sky[1]
        set_lighting(frame, lighting, pose, None if floor is None else floor.albedo, mean)
        if floor is not None:
            frame.set_vector("floor_light", lighting.on(pose.focus, floor.normal))
        return lighting.lights

    def bind(self) -> None:
        """Bind the skybox."""
        if self._sky is not None:
            self._sky[0].use(Unit.SKYBOX)
