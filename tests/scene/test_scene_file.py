"""The table of a scene: every value arrives, and what is wrong is named with its place.

Cameras that the model does not have, and exposures that cannot be, are refused with what is valid.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene_file import MAX_EXPOSURES, CameraEntry, RippleEntry, check_camera, parse_scene

LEAST = {"model": "scene.xml", "ripple": [{"geom": "egg"}]}


def changed(**entries: object) -> dict:
    return {**LEAST, **entries}


def test_the_least_scene_has_the_defaults_that_are_written_down() -> None:
    scene = parse_scene(LEAST, "a.toml")
    assert (scene.duration, scene.two_way, scene.lighting, scene.overlay) == (5.0, False, "auto", [])
    assert scene.camera == CameraEntry()
    assert scene.random is None
    [entry] = scene.ripple
    assert (entry.geom, entry.resolution, entry.look, entry.color, entry.still) == ("egg", None, "rubber", None, [])


def test_entries_of_one_scene_share_no_lists_with_another() -> None:
    first, second = parse_scene(LEAST, "a.toml"), parse_scene(LEAST, "a.toml")
    first.overlay.append("time")
    first.ripple[0].still.append(None)
    assert second.overlay == second.ripple[0].still == []


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (changed(colour=1), "scene file 'a.toml': unknown key 'colour'; valid are model, ripple, duration"),
        (changed(camera={"fov": 1}), r"unknown key 'fov' in \[camera\]; valid are name, track"),
        (
            changed(ripple=[{"geom": "egg"}, {"geo": "b"}]),
            r"unknown key 'geo' in \[ripple\]; valid are geom, resolution",
        ),
        (
            changed(ripple=[{"geom": "egg", "still": [{"r": 1}]}]),
            r"unknown key 'r' in \[ripple.still\]; valid are point",
        ),
        (changed(change=[{"material": {"sped": 1}}]), r"unknown key 'sped' in \[change.material\]; valid are speed"),
        (changed(random={"sizes": 1}), r"unknown key 'sizes' in \[random\]; valid are seed, position"),
        ({"ripple": []}, "Object missing required field `model`"),
        (changed(model=3), "Expected `str`, got `int` - at `model`"),
        (changed(ripple={"geom": "egg"}), "Expected `array`, got `object` - at `ripple`"),
        (changed(camera={"lookat": [1, 2]}), "length 3.* at `camera.lookat`"),
        (changed(poke=[{"geom": "egg", "time": "now"}]), r"Expected `float`, got `str` - at `poke\[0\].time`"),
        (changed(camera=4), "Expected `object`, got `int` - at `camera`"),
        (changed(duration=True), "Expected `float`, got `bool` - at `duration`"),
    ],
)
def test_mistakes_are_named_with_file_place_and_what_is_valid(table: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message) as error:
        parse_scene(table, "a.toml")
    assert str(error.value).startswith("scene file 'a.toml': ")
    assert "$" not in str(error.value)


@pytest.mark.parametrize("number", [float("nan"), float("inf"), float("-inf"), 1.1e12, -(10**13), 10**400])
def test_numbers_without_sense_are_refused_wherever_they_are(number: float) -> None:
    for place, table in (
        ("duration", changed(duration=number)),
        ("camera.lookat", changed(camera={"lookat": [0.0, number, 0.0]})),
        ("ripple.still.radius", changed(ripple=[{"geom": "egg", "still": [{"point": [0, 0, 0], "radius": number}]}])),
    ):
        with pytest.raises(SceneError, match=rf"{place} is .*; valid are numbers up to 1e\+12"):
            parse_scene(table, "a.toml")


def test_numbers_up_to_the_largest_are_read_as_they_are() -> None:
    assert parse_scene(changed(duration=1e12), "a.toml").duration == 1e12
    assert parse_scene(changed(duration=3), "a.toml").duration == 3.0


def test_images_are_found_beside_the_scene_file_and_given_paths_stay() -> None:
    entry = RippleEntry(geom="egg", still_map="still.png")
    assert entry.located(Path("/there")).still_map == str(Path("/there/still.png"))
    assert entry.still_map == "still.png"
    assert RippleEntry(geom="egg", still_map="/here/still.png").located(Path("/there")).still_map == "/here/still.png"
    assert RippleEntry(geom="egg").located(Path("/there")) == RippleEntry(geom="egg")


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
