"""Cameras that the model does not have, and exposures that cannot be, are refused with what is valid."""

import mujoco
import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene_file import MAX_EXPOSURES, CameraEntry, check_camera

MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><camera name="eye" pos="0 -3 1"/><camera pos="0 -3 1"/><camera name="side" pos="3 0 1"/>
    <geom name="egg" size="0.1"/><body name="stone" pos="0 0 1"><geom name="pebble" size="0.05"/></body>
    </worldbody></mujoco>"""
)
BARE = mujoco.MjModel.from_xml_string("<mujoco/>")


@pytest.mark.parametrize(
    "entry",
    [
        {},
        {"name": "eye", "track": "stone", "focus": "pebble"},
        {"track": "world"},
        {"shutter": 0.0, "aperture": 0.0, "exposures": 1},
        {"shutter": 360.0, "exposures": MAX_EXPOSURES},
        {"focus": (0.0, 0.0, 0.0)},
        {"focus": 1e-9},
        {"focus": "stone"},
    ],
)
def test_what_the_model_has_and_the_optics_allow_is_accepted(entry: dict) -> None:
    check_camera(MODEL, CameraEntry(**entry))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"name": "ear"}, "no camera 'ear'; its cameras are eye, side$"),
        ({"name": ""}, "no camera ''; its cameras are eye, side$"),
        ({"track": "pebble"}, "no body 'pebble' for the camera to track; its bodies are world, stone$"),
        ({"focus": "moon"}, "nothing 'moon' .* bodies are world, stone; its geoms are egg, pebble$"),
        ({"focus": 0.0}, "focus is 0.0; valid is more than 0 m"),
        ({"focus": -2.0}, "focus is -2.0"),
        ({"focus": np.inf}, "focus is inf"),
        ({"shutter": 360.1}, "shutter angle is 360.1; valid is 0 to 360 degrees"),
        ({"shutter": np.nan}, "shutter angle is nan"),
        ({"aperture": -0.01}, "aperture is -0.01; valid is 0 m or more"),
        ({"aperture": np.inf}, "aperture is inf"),
        ({"exposures": 0}, "number of exposures is 0; valid is 1 to 1024"),
        ({"exposures": MAX_EXPOSURES + 1}, "number of exposures is 1025"),
    ],
)
def test_what_cannot_be_is_named_with_its_value_and_what_is_valid(entry: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        check_camera(MODEL, CameraEntry(**entry))


def test_a_model_without_cameras_says_so() -> None:
    with pytest.raises(SceneError, match=r"no camera 'eye'; its cameras are none$"):
        check_camera(BARE, CameraEntry(name="eye"))
