"""A scene through another camera or with another exposure: what has no effect is refused."""

import dataclasses

import mujoco
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene import Scene, through_camera, with_exposure
from ripple_sim.scene.scene_file import CameraEntry, RippleEntry

MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><camera name="eye" pos="0 -3 1"/><camera name="side" pos="3 0 1"/>
    <geom name="egg" size="0.1"/><body name="stone" pos="0 0 1"><geom size="0.05"/></body></worldbody></mujoco>"""
)


def scene(**camera: object) -> Scene:
    return Scene("still", MODEL, (RippleEntry(geom="egg"),), CameraEntry(**camera), 1.0)


def test_through_camera_changes_the_camera_alone_and_not_the_scene_itself() -> None:
    before = scene(shutter=180.0)
    after = through_camera(before, "side")
    assert after.camera == CameraEntry(name="side")
    assert before.camera == CameraEntry(shutter=180.0)
    assert dataclasses.replace(after, camera=before.camera).__dict__ == before.__dict__
    with pytest.raises(SceneError, match="no camera 'ear'; its cameras are eye, side"):
        through_camera(before, "ear")


def test_exposure_replaces_what_is_given_and_leaves_what_is_none() -> None:
    before = scene(azimuth=12.0, shutter=90.0, aperture=0.1, exposures=8)
    after = with_exposure(before, shutter=180, aperture=None, focus="stone", exposures=None)
    assert after.camera == CameraEntry(azimuth=12.0, shutter=180.0, aperture=0.1, focus="stone", exposures=8)
    assert with_exposure(before).camera == before.camera
    assert with_exposure(before, aperture=0.0).camera.aperture == 0.0, "0 is a value"


@pytest.mark.parametrize(
    ("camera", "changes", "message"),
    [
        ({}, {"shutter": "wide"}, r"camera: Expected `float`, got `str` - at `shutter`"),
        ({}, {"exposures": 2.5}, r"camera: .*`exposures`"),
        ({}, {"shutter": 400}, "shutter angle is 400"),
        ({}, {"focus": 1.0}, "a focus needs a lens: give the camera an aperture of more than 0 m"),
        ({"shutter": 180.0}, {"focus": "stone"}, "a focus needs a lens"),
        ({}, {"exposures": 16}, "all 16 exposures would be the same: give the camera a shutter angle"),
        ({"shutter": 180.0}, {"shutter": 0.0, "exposures": 2}, "all 2 exposures would be the same"),
    ],
)
def test_an_exposure_without_effect_or_sense_is_refused(camera: dict, changes: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        with_exposure(scene(**camera), **changes)


def test_one_exposure_needs_neither_shutter_nor_lens() -> None:
    assert with_exposure(scene(), exposures=1).camera.exposures == 1
    assert with_exposure(scene(shutter=180.0), exposures=16).camera.exposures == 16
