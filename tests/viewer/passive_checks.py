"""Checks of MuJoCo's viewer with ripples, which `test_passive.py` runs in a process."""

import time
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest
from PIL import ImageGrab

from ripple_sim import Material, Ripples, launch_passive
from ripple_sim.errors import SceneError
from ripple_sim.viewer import RippleViewer

MODEL = """<mujoco><visual><headlight ambient=".3 .3 .3"/></visual>
<asset><material name="clay" rgba=".9 .6 .3 1"/></asset><worldbody>
<geom type="plane" size="2 2 .1"/>
<body pos="0 0 .4"><geom name="egg" type="ellipsoid" size=".4 .3 .3" material="clay"/></body>
</worldbody></mujoco>"""
SIDE = [0.0, -0.3, 0.0]  # towards the camera


@pytest.fixture(scope="module")
def opened() -> Iterator[tuple[RippleViewer, Ripples, mujoco.MjData]]:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    ripples = Ripples(
        model,
        {"egg": Material(speed=0.6, damping=2.0, density=300.0)},
        resolution=32,
        backend="cpu",
    )
    with launch_passive(model, data, ripples, show_left_ui=False, show_right_ui=False) as viewer:
        with viewer.lock():
            viewer.cam.lookat = (0, 0, 0.4)
            viewer.cam.distance = 1.6
            viewer.cam.elevation = -20
        yield viewer, ripples, data
    assert not viewer.is_running()


def picture(viewer: RippleViewer, other: np.ndarray | None = None) -> np.ndarray:
    """The picture on the screen, once it is drawn and differs from another picture."""
    end = time.monotonic() + 60  # a machine that has more to do draws late
    while time.monotonic() < end:
        viewer.sync()
        time.sleep(0.1)
        seen = np.asarray(ImageGrab.grab().convert("L"), float)
        if seen.mean() > 1 and (other is None or np.abs(seen - other).mean() > 1):
            return seen
    raise AssertionError("the picture stays as it was")


def height_at(ripples: Ripples, point: list[float]) -> float:
    waves = ripples["egg"]
    places = waves.atlas.positions.reshape(-1, 3)
    return float(waves.height.reshape(-1)[np.linalg.norm(places - point, axis=1).argmin()])


def test_ripples_are_seen_and_the_model_stays_as_it_was(opened) -> None:
    viewer, ripples, _ = opened
    color = ripples.model.geom("egg").rgba.copy()
    viewer.user_scn.ngeom = 1
    place = np.array([0.3, -0.6, 0.4])
    mujoco.mjv_initGeom(
        viewer.user_scn.geoms[0],
        2,
        np.full(3, 0.03),
        place,
        np.eye(3).ravel(),
        np.ones(4, np.float32),
    )
    still = picture(viewer)
    ripples["egg"].height = 0.04 * np.cos(60 * ripples["egg"].atlas.positions[..., 0])
    waves = picture(viewer, still)
    ripples["egg"].reset()
    picture(viewer, waves)
    assert viewer.user_scn.ngeom == 1
    np.testing.assert_array_equal(ripples.model.geom("egg").rgba, color)


@pytest.mark.parametrize("pull", [0.05, -0.05])
def test_the_surface_follows_the_mouse(opened, pull: float) -> None:
    viewer, ripples, data = opened
    ripples["egg"].reset()
    viewer.pert.select = 1
    viewer.pert.localpos = SIDE
    viewer.pert.refselpos = [0.0, SIDE[1] + pull, 0.4]
    for active in (0, int(mujoco.mjtPertBit.mjPERT_TRANSLATE)):
        assert np.abs(ripples["egg"].height).max() == 0
        viewer.pert.active = active
        for _ in range(8):
            ripples.mj_step(data, nstep=25)
            viewer.sync()
    viewer.pert.active = 0
    assert 0.3 < height_at(ripples, SIDE) / -pull < 3


def test_ripples_of_another_model_are_refused(opened) -> None:
    _, ripples, data = opened
    other = mujoco.MjModel.from_xml_string(MODEL)
    with pytest.raises(SceneError, match="ripples of the model that it is given"):
        launch_passive(other, data, ripples)
