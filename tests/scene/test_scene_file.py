"""Tables of a scene file: values arrive, and mistakes are named with their place."""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scene_files import write_scene

from ripple_sim import Simulation, scene
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.scene import CameraEntry, CameraKey, Events, RippleEntry, Scene, StillEntry
from ripple_sim.solver import RippleError

LEAST = {"model": "scene.xml", "ripple": [{"geom": "egg"}]}


def changed(**entries: object) -> dict:
    return {**LEAST, **entries}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            changed(colour=1),
            "scene file 'a.toml': unknown key 'colour'; keys are model, ripple, duration",
        ),
        (
            changed(ripple=[{"geom": "egg"}, {"geo": "b"}]),
            r"unknown key 'geo' in \[ripple\]; keys are geom, resol",
        ),
        (
            changed(ripple=[{"geom": "a", "still": [{"r": 1}]}]),
            r"unknown key 'r' in \[ripple.still\]; keys are point",
        ),
        ({"ripple": []}, "Object missing required field `model`"),
        (
            changed(ripple={"geom": "egg"}),
            r"\[ripple\] is one table, where there may be several; write \[\[ripple\]\]",
        ),
        (changed(ripple=[{"geom": "a", "still": {"radius": 1}}]), r"write \[\[ripple.still\]\]"),
        (changed(camera={"lookat": [1, 2]}), "length 3.* at `camera.lookat`"),
        (
            changed(poke=[{"geom": "egg", "time": "now"}]),
            r"Expected `float`, got `str` - at `poke\[0\].time`",
        ),
        (changed(throw=[{"body": "stone", "time": 0}]), "missing required field `velocity`"),
        (changed(duration=True), "Expected `float`, got `bool` - at `duration`"),
    ],
)
def test_mistakes_are_named_with_file_place_and_expected_values(table: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message) as error:
        scene.parse_scene(table, "a.toml")
    assert str(error.value).startswith("scene file 'a.toml': ")
    assert "$" not in str(error.value)


@pytest.mark.parametrize(
    "number", [float("nan"), float("inf"), float("-inf"), 1.1e12, -(10**13), 10**400]
)
def test_numbers_without_sense_are_refused_wherever_they_are(number: float) -> None:
    for place, table in (
        ("duration", changed(duration=number)),
        ("camera.lookat", changed(camera={"lookat": [0.0, number, 0.0]})),
        (
            "ripple.still.radius",
            changed(ripple=[{"geom": "egg", "still": [{"point": [0, 0, 0], "radius": number}]}]),
        ),
    ):
        with pytest.raises(SceneError, match=rf"{place} must be a number up to 1e\+12, got"):
            scene.parse_scene(table, "a.toml")
    assert scene.parse_scene(changed(duration=1e12), "a.toml").duration == 1e12


def test_images_are_found_beside_the_scene_file_and_given_paths_stay() -> None:
    entry = RippleEntry(geom="egg", still_map="still.png")
    assert entry.located(Path("/there")).still_map == str(Path("/there/still.png"))
    assert entry.still_map == "still.png"
    assert (
        RippleEntry(geom="egg", still_map="/here/still.png").located(Path("/there")).still_map
        == "/here/still.png"
    )
    assert RippleEntry(geom="egg").located(Path("/there")) == RippleEntry(geom="egg")


MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><camera name="eye" pos="0 -3 1"/><camera pos="0 -3 1"/>
    <camera name="side" pos="3 0 1"/>
    <camera name="follower" pos="3 1 1" mode="targetbody" target="stone"/>
    <geom name="egg" size="0.1"/><body name="stone" pos="0 0 1"><geom name="pebble" size="0.05"/>
    </body>
    </worldbody></mujoco>"""
)


@pytest.mark.parametrize(
    "entry",
    [
        {},
        {"name": "eye", "track": "stone", "focus": "pebble"},
        {"track": "world"},
        {"shutter": 0.0, "aperture": 0.0, "exposures": 1},
        {"shutter": 360.0, "exposures": scene.MAX_EXPOSURES},
        {"focus": (0.0, 0.0, 0.0)},
        {"focus": 1e-9},
        {"focus": "stone"},
        {"name": "eye", "orbit": 5.0, "track": "stone"},
        {"name": "follower", "orbit": 5.0},
        {"orbit": 5.0, "key": [CameraKey(time=0.0, distance=1.0), CameraKey(time=1.0, fovy=9.0)]},
    ],
)
def test_valid_cameras_are_accepted(entry: dict) -> None:
    scene.check_camera(MODEL, CameraEntry(**entry))


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"name": "ear"}, "no camera 'ear'; its cameras are eye, side, follower$"),
        ({"name": ""}, "no camera ''; its cameras are eye, side, follower$"),
        (
            {"track": "pebble"},
            "no body 'pebble' for the camera to track; its bodies are world, stone$",
        ),
        (
            {"focus": "moon"},
            "nothing 'moon' .* bodies are world, stone; its geoms are egg, pebble$",
        ),
        ({"focus": 0.0}, "focus must be more than 0 m.*, got 0.0"),
        ({"focus": -2.0}, "focus must be .*, got -2.0"),
        ({"focus": np.inf}, "focus must be .*, got inf"),
        ({"shutter": 360.1}, "shutter angle must be 0 to 360 degrees.*, got 360.1"),
        ({"shutter": np.nan}, "shutter angle must be .*, got nan"),
        ({"aperture": -0.01}, "aperture must be 0 m or more.*, got -0.01"),
        ({"aperture": np.inf}, "aperture must be .*, got inf"),
        (
            {"name": "eye", "orbit": 5.0},
            "'eye' of the model turns to no body, so orbit = 5 has no point to circle; add track",
        ),
        (
            {"name": "eye", "key": [CameraKey(time=0.0, distance=1.0)]},
            "moves the free camera, and the camera 'eye' of the model has a pose of its own",
        ),
        (
            {"orbit": 5.0, "key": [CameraKey(time=0.0, azimuth=1.0)]},
            "orbit = 5 and the azimuths of .* both turn the camera",
        ),
        (
            {"key": [CameraKey(time=1.0, distance=1.0), CameraKey(time=1.0, distance=2.0)]},
            "at 1 s follows one at 1 s; the times of keys must increase",
        ),
        ({"key": [CameraKey(time=0.5)]}, "at 0.5 s gives nothing but its time; give .*lookat"),
        ({"key": [CameraKey(time=0.0, distance=0.0)]}, "distance must be more than 0 m.*, got 0.0"),
        ({"key": [CameraKey(time=0.0, fovy=180.0)]}, "fovy must be between 0 and 180.*, got 180.0"),
        ({"exposures": 0}, "number of exposures must be 1 to 1024.*, got 0"),
        ({"exposures": scene.MAX_EXPOSURES + 1}, "number of exposures must be .*, got 1025"),
    ],
)
def test_invalid_cameras_are_refused_with_the_value_and_valid_values(
    entry: dict, message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        scene.check_camera(MODEL, CameraEntry(**entry))


EGGS = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><geom name="egg" size="0.1"/>
    <geom name="floor" type="plane" size="1 1 1"/>
    <geom name="pea" size="0.1" pos="1 0 0"/></worldbody></mujoco>"""
)
EGG = RippleEntry(geom="egg")


def checked(*targets: RippleEntry, **others: object) -> None:
    scene.check_scene(
        Scene(
            **{
                "name": "s",
                "model": EGGS,
                "targets": targets,
                "camera": CameraEntry(),
                "duration": 1.0,
                **others,
            }
        )
    )


def still(radius: float) -> RippleEntry:
    return RippleEntry(geom="egg", still=[StillEntry((0, 0, 0.1), radius)])


def test_a_scene_without_mistakes_passes() -> None:
    checked(EGG, RippleEntry(geom="pea", color=(0, 0.5, 1)))
    checked(
        EGG, duration=scene.MAX_DURATION - 1.0, overlay=("height=0.02", "time"), lighting="studio"
    )
    checked(still(0.01))


def test_warning_about_an_event_after_the_end() -> None:
    poke = scene.PokeEntry("egg", 1.0, (0, 0, 0.1), 1.0)
    with pytest.warns(
        RippleWarning, match=r"a \[\[poke\]\] at 1 s is not before the scene's end, 1 s; give"
    ):
        checked(EGG, events=Events(poke=[poke]))


@pytest.mark.parametrize(
    ("targets", "others", "message"),
    [
        ((), {}, r"scene 's' has no \[\[ripple\]\] entry; name at least one geom"),
        (
            (EGG,),
            {"duration": 0.0},
            "duration must be a positive number, less than 86400, got 0.0 s",
        ),
        ((EGG,), {"duration": float("nan")}, "duration must be .*, got nan"),
        ((EGG,), {"duration": float(scene.MAX_DURATION)}, "duration must be .*, got 86400.0"),
        ((EGG, EGG), {}, r"geom 'egg' must have one \[\[ripple\]\] entry, got two"),
        ((RippleEntry(geom="leg"),), {}, "no geom 'leg'; its geoms are 'egg', 'floor', 'pea'"),
        ((RippleEntry(geom="floor"),), {}, "geom 'floor' is a plane, which cannot ripple"),
        (
            (RippleEntry(geom="egg", look="lead"),),
            {},
            "look must be one of .*rubber.*, got 'lead'",
        ),
        (
            (RippleEntry(geom="egg", layout="octahedron"),),
            {},
            "layout must be one of auto.*, got .octahedron.",
        ),
        (
            (RippleEntry(geom="egg", rim="bent"),),
            {},
            "rim must be one of free, supported, clamped, fixed, got 'bent'",
        ),
        (
            (RippleEntry(geom="egg", color=(0, 0, 1.1)),),
            {},
            "color of geom 'egg' must be three numbers from 0 to 1",
        ),
        ((RippleEntry(geom="egg", color=(0, float("nan"), 1)),), {}, "three numbers from 0 to 1"),
        (
            (RippleEntry(geom="egg", material=scene.MaterialEntry(speed=-1.0)),),
            {},
            "speed must be .*, got -1",
        ),
        ((EGG,), {"overlay": ("depth",)}, "no overlay 'depth'; overlays are height, velocity"),
        ((EGG,), {"lighting": "dark"}, "lighting must be one of .*'auto'.*, got 'dark'"),
        ((EGG,), {"camera": CameraEntry(name="eye")}, "no camera 'eye'; its cameras are none"),
        (
            (EGG,),
            {"events": Events(drop=[scene.DropEntry("egg", 0.0)])},
            r"\[\[drop\]\] names the body 'egg'",
        ),
        (
            (EGG,),
            {"events": Events(poke=[scene.PokeEntry("pea", 0.0, (0, 0, 0), 1.0)])},
            "'pea', which does not ripple; the rippling geoms are 'egg'",
        ),
        (
            (RippleEntry(geom="egg", still_map="/none.png"),),
            {},
            "ripple.still_map names the image '/none.png', which",
        ),
        (
            (RippleEntry(geom="egg", still_map="/"),),
            {},
            "it must be the path of an image relative to the scene file",
        ),
        *(
            ((still(radius),), {}, f"radius of a .* must be above 0, got {radius} m")
            for radius in (0.0, -1.0, np.inf, np.nan)
        ),
    ],
)
def test_each_mistake_is_named_with_its_value_and_the_expected_values(
    targets, others: dict, message: str
) -> None:
    with pytest.raises(RippleError, match=message):
        checked(*targets, **others)


MJCF = """<mujoco><worldbody><camera name="eye" pos="0 -3 1"/>
<geom name="floor" type="plane" size="1 1 1"/>
<geom name="egg" type="ellipsoid" size="0.3 0.2 0.2"/>
<body name="stone" pos="0 0 1"><freejoint/><geom name="stone" size="0.05"/></body></worldbody>
</mujoco>"""
TOML = """model = "scene.xml"
[camera]
name = "eye"
[[ripple]]
geom = "egg"
resolution = 16
[ripple.material]
speed = 0.5
[[drop]]
body = "stone"
time = 0.25
velocity = [0.5, 0.0, 0.0]
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "speed = 0.5",
            "sped = 0.5",
            r"unknown key 'sped' in \[ripple.material\]; keys are speed, damping",
        ),
        ('geom = "egg"', 'geom = "eg"', "its geoms are 'floor', 'egg', 'stone'"),
        ('body = "stone"', 'body = "rock"', "bodies are stone"),
    ],
)
def test_a_file_is_checked_in_itself_against_its_model_and_in_its_events(
    tmp_path, old, new, message
) -> None:
    with pytest.raises(RippleError, match=message) as error:
        scene.load_scene(write_scene(tmp_path, MJCF, TOML.replace(old, new)))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("fps", [24, 60, 1000])
def test_a_whole_number_of_physics_steps_makes_a_frame(tmp_path: Path, fps: int) -> None:
    simulation = Simulation(
        scene.load_scene(write_scene(tmp_path, MJCF, TOML)), fps=fps, backend="cpu"
    )
    for _ in range(5):
        simulation.advance_frame()
    assert simulation.data.time == pytest.approx(5 / fps, rel=1e-9)
    assert simulation.model.opt.timestep <= 0.002 + 1e-12


def filmed(**camera: object) -> Scene:
    return Scene("still", MODEL, (RippleEntry(geom="egg"),), CameraEntry(**camera), 1.0)


def test_through_camera_returns_a_copy_with_another_camera() -> None:
    before = filmed(shutter=180.0)
    after = scene.through_camera(before, "side")
    assert after.camera == CameraEntry(name="side")
    assert before.camera == CameraEntry(shutter=180.0)
    assert dataclasses.replace(after, camera=before.camera).__dict__ == before.__dict__
    with pytest.raises(SceneError, match="no camera 'ear'; its cameras are eye, side"):
        scene.through_camera(before, "ear")
    assert scene.through_camera(before, None) is before


def test_a_scene_file_gives_the_path_of_the_camera(tmp_path: Path) -> None:
    keys = "[[camera.key]]\ntime = 0.0\nazimuth = 10\n[[camera.key]]\ntime = 1.5\nfovy = 30\n"
    free = TOML.replace('name = "eye"', "elevation = -30.0") + keys
    loaded = scene.load_scene(write_scene(tmp_path, MJCF, free))
    assert loaded.camera.key == [
        CameraKey(time=0.0, azimuth=10.0),
        CameraKey(time=1.5, fovy=30.0),
    ]
    wrong = free.replace("azimuth", "azimut")
    with pytest.raises(SceneError, match=r"'azimut' in \[camera.key\]; keys are time, lookat"):
        scene.load_scene(write_scene(tmp_path, MJCF, wrong))


def test_exposure_replaces_given_values_and_leaves_the_others() -> None:
    before = filmed(azimuth=12.0, shutter=90.0, aperture=0.1, exposures=8)
    after = scene.with_exposure(before, shutter=180, aperture=None, focus="stone", exposures=None)
    assert after.camera == CameraEntry(
        azimuth=12.0, shutter=180.0, aperture=0.1, focus="stone", exposures=8
    )
    assert scene.with_exposure(before).camera == before.camera
    moving = filmed(key=[CameraKey(time=0.0, distance=1.0)])
    assert scene.with_exposure(moving, shutter=180).camera.key == moving.camera.key
    assert scene.with_exposure(before, aperture=0.0).camera.aperture == 0.0, "0 is a value"


@pytest.mark.parametrize(
    ("camera", "changes", "message"),
    [
        ({}, {"shutter": "wide"}, r"camera: Expected `float`, got `str` - at `shutter`"),
        ({}, {"exposures": 2.5}, r"camera: .*`exposures`"),
        ({}, {"shutter": 400}, "shutter angle must be .*, got 400"),
        ({}, {"focus": 1.0}, "a focus needs a lens: give the camera an aperture of more than 0 m"),
        ({"shutter": 180.0}, {"focus": "stone"}, "a focus needs a lens"),
        (
            {},
            {"exposures": 16},
            "all 16 exposures would be the same: give the camera a shutter angle",
        ),
        ({"shutter": 180.0}, {"shutter": 0.0, "exposures": 2}, "all 2 exposures would be the same"),
    ],
)
def test_an_exposure_without_effect_or_sense_is_refused(
    camera: dict, changes: dict, message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        scene.with_exposure(filmed(**camera), **changes)


def test_an_overlay_request_takes_every_name_and_a_range() -> None:
    request = scene.parse_request([" height=0.02", "contacts", "grid", "time", "energy "])
    assert request == scene.Request("height", 0.02, True, True, True, True)
    assert scene.parse_request(["velocity"]) == scene.Request(heatmap="velocity")
    assert scene.parse_request([]) == scene.Request()
    assert scene.parse_request(["time"]) == scene.Request(time=True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["hight"], ", ".join(scene.NAMES)),
        ([""], "overlays are"),
        (["height", "velocity"], "choose one"),
        (["height=0"], "positive number"),
        (["height=wide"], "positive number"),
        (["velocity=inf"], "m/s"),
        (["time=3"], "has no range"),
    ],
)
def test_invalid_overlay_requests_are_refused(words: list[str], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        scene.parse_request(words)


@pytest.mark.parametrize(
    "text, said",
    [
        # tomllib would take half an hour
        (".".join(["a"] * 200_000) + " = 1", r"plan '.*a\.toml': a key must have .*, got 200000"),
        ("[" + " . ".join(["'a'"] * 101) + "]", "a key must have at most 100 parts .*, got 101"),
        ("a = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a", "is not valid TOML"),
        ("a = \ud800", "cannot be read"),
    ],
)
def test_files_that_are_no_tables_are_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(text.encode(errors="surrogatepass"))
    with pytest.raises(SceneError, match=said):
        scene.read_toml(path, "plan")


def test_dots_in_numbers_paths_and_comments_are_no_keys(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(
        f"# {'.' * 300}\n# {'. ' * 300}\na = [{', '.join(['0.5'] * 300)}]\nb.c = '../../x.y'\n"
    )
    assert scene.read_toml(path, "plan") == {"a": [0.5] * 300, "b": {"c": "../../x.y"}}
