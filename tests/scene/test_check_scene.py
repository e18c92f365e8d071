"""A scene is checked against its model as a whole: each mistake by itself is found and named."""

from pathlib import Path

import mujoco
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.events import DropEntry, Events, PokeEntry
from ripple_sim.scene.load_scene import check_scene
from ripple_sim.scene.material_entry import MaterialEntry
from ripple_sim.scene.scene import MAX_DURATION, Scene
from ripple_sim.scene.scene_file import CameraEntry, RippleEntry, StillEntry
from ripple_sim.solver import RippleError

MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><geom name="egg" size="0.1"/><geom name="floor" type="plane" size="1 1 1"/>
    <geom name="pea" size="0.1" pos="1 0 0"/></worldbody></mujoco>"""
)
EGG = RippleEntry(geom="egg")


def checked(*targets: RippleEntry, **others: object) -> None:
    check_scene(
        Scene(**{"name": "s", "model": MODEL, "targets": targets, "camera": CameraEntry(), "duration": 1.0, **others})
    )


def test_a_scene_without_mistakes_passes() -> None:
    checked(EGG, RippleEntry(geom="pea", color=(0, 0.5, 1)))
    checked(EGG, duration=MAX_DURATION - 1.0, overlay=("height=0.02", "time"), lighting="studio")
    checked(RippleEntry(geom="egg", still=[StillEntry((0, 0, 0.1), 0.01)]))


@pytest.mark.parametrize(
    ("targets", "others", "message"),
    [
        ((), {}, r"scene 's' has no \[\[ripple\]\] entry; name at least one geom"),
        ((EGG,), {"duration": 0.0}, "duration is 0.0 s; valid is a positive number, less than 86400"),
        ((EGG,), {"duration": float("nan")}, "duration is nan"),
        ((EGG,), {"duration": float(MAX_DURATION)}, "duration is 86400.0"),
        ((EGG, EGG), {}, r"geom 'egg' has two \[\[ripple\]\] entries; valid is one"),
        ((RippleEntry(geom="leg"),), {}, "no geom 'leg'; its geoms are 'egg', 'floor', 'pea'"),
        ((RippleEntry(geom="floor"),), {}, "geom 'floor' is a plane, which cannot ripple"),
        ((RippleEntry(geom="egg", look="lead"),), {}, "look 'lead' does not exist; valid are .*rubber"),
        (
            (RippleEntry(geom="egg", layout="octahedron"),),
            {},
            "layout .octahedron. does not exist; valid are auto",
        ),
        ((RippleEntry(geom="egg", rim="bent"),), {}, "rim 'bent' does not exist; valid are free, fixed"),
        ((RippleEntry(geom="egg", color=(0, 0, 1.1)),), {}, "color of geom 'egg' is .*three numbers from 0 to 1"),
        ((RippleEntry(geom="egg", color=(0, float("nan"), 1)),), {}, "three numbers from 0 to 1"),
        ((RippleEntry(geom="egg", material=MaterialEntry(speed=-1.0)),), {}, "speed is -1"),
        ((EGG,), {"overlay": ("depth",)}, "no overlay 'depth'; valid are height, velocity"),
        ((EGG,), {"lighting": "dark"}, "lighting is 'dark'; valid are .*'auto'"),
        ((EGG,), {"camera": CameraEntry(name="eye")}, "no camera 'eye'; its cameras are none"),
        ((EGG,), {"events": Events(drop=[DropEntry("egg", 0.0)])}, r"\[\[drop\]\] names the body 'egg'"),
        (
            (EGG,),
            {"events": Events(poke=[PokeEntry("pea", 0.0, (0, 0, 0), 1.0)])},
            "'pea', which does not ripple; the rippling geoms are 'egg'",
        ),
        ((RippleEntry(geom="egg", still_map="/none.png"),), {}, "ripple.still_map names the image '/none.png', which"),
        *(
            (
                (RippleEntry(geom="egg", still=[StillEntry((0, 0, 0), radius)]),),
                {},
                f"radius {radius} m; valid is above 0",
            )
            for radius in (0.0, -1.0, float("inf"), float("nan"))
        ),
    ],
)
def test_each_mistake_is_named_with_its_value_and_what_is_valid(targets, others: dict, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        checked(*targets, **others)


def test_a_folder_is_not_an_image(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="does not exist; valid is the path of an image relative to the scene file"):
        checked(RippleEntry(geom="egg", still_map=str(tmp_path)))
