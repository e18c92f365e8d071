"""dm_control's `Physics` ripples, though its steps end with the beginning of the next."""

import importlib.util
import warnings
from typing import Any

import mujoco
import numpy as np
import pytest
from stand_in_physics import StandIn

from ripple_sim import Material, Ripples, RippleWarning
from ripple_sim.dm_control import couple

MASS = 0.3
MODEL = f"""<mujoco><option timestep="0.002"/><worldbody>
<geom name="block" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1" solref="0.01 0.3"/>
<body name="ball" pos="0.03 0.02 0.06"><freejoint/>
<geom size="0.05" mass="{MASS}" solref="0.01 0.3"/></body>
</worldbody></mujoco>"""
MATERIALS = {"block": Material(speed=1.0, density=100.0)}
OPTIONS: dict[str, Any] = {"resolution": 16, "backend": "cpu"}


# the stand-in everywhere, and the package itself where it is installed
KINDS: list[Any] = [StandIn]
if importlib.util.find_spec("dm_control"):
    from dm_control.mujoco import Physics

    KINDS.append(Physics.from_xml_string)


@pytest.mark.parametrize("make", KINDS)
@pytest.mark.parametrize("legacy", [True, False])
def test_waves_advance_at_each_physics_step(
    make: Any, legacy: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    physics = make(MODEL)
    physics.legacy_step = legacy
    ripples = couple(physics, MATERIALS, **OPTIONS)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    plain = Ripples(model, MATERIALS, **OPTIONS)
    with warnings.catch_warnings(action="error", category=RippleWarning):
        for _ in range(2):
            given = 0.0
            for _ in range(20):
                physics.step(5)
                physics.step()
                given += sum(impulse.impulse for impulse in ripples.last_impulses)
                physics.step(nstep=4)
                given += sum(impulse.impulse for impulse in ripples.last_impulses)
                plain.mj_step(data, nstep=10)
            np.testing.assert_array_equal(ripples["block"].height, plain["block"].height)
            physics.reset()
            assert not ripples["block"].height.any()
            mujoco.mj_resetData(model, data)
    assert given > 0


@pytest.mark.parametrize("make", KINDS)
def test_render_draws_dm_controls_picture_with_the_ripples(make: Any) -> None:
    physics = make(MODEL)
    ripples = couple(physics, MATERIALS, looks={"block": "clay"}, lighting="studio", **OPTIONS)
    size = {"height": 24, "width": 32}
    plain = physics.render(**size)
    depth = physics.render(**size, depth=True)
    segmentation = physics.render(**size, segmentation=True)
    assert (plain.shape, depth.shape) == ((24, 32, 3), (24, 32))
    assert {tuple(each) for each in segmentation.reshape(-1, 2)} == {(-1, -1), (0, 5), (1, 5)}
    ripples["block"].velocity = np.random.default_rng(2).standard_normal((6, 16, 16)) / 10
    ripples["block"].step(0.02)
    assert np.abs(physics.render(**size).astype(int) - plain).mean() > 0.5  # codes of 255
    on_block = segmentation[..., 0] == 0
    change_of_depth = np.abs(physics.render(**size, depth=True) - depth)[on_block]
    assert 1e-4 < np.median(change_of_depth) < 0.05  # [m]
    option = mujoco.MjvOption()
    option.geomgroup[:] = 0
    assert (physics.render(**size, segmentation=True, scene_option=option) == -1).all()

    def added(_: Any, scene: mujoco.MjvScene) -> None:
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom],
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=np.full(3, 0.2),
            pos=np.zeros(3),
            mat=np.eye(3).ravel(),
            rgba=[1.0, 0.0, 0.0, 1.0],
        )
        scene.ngeom += 1

    assert np.abs(physics.render(**size, scene_callback=added).astype(int) - plain).max() > 50
    with pytest.raises(ValueError, match="depth and segmentation must not both be True"):
        physics.render(depth=True, segmentation=True)
    with pytest.warns(RippleWarning, match="overlays are not drawn"):
        physics.render(**size, overlays=["text"])
    with pytest.warns(RippleWarning, match="flags have no effect: mjRND_WIREFRAME"):
        physics.render(**size, render_flag_overrides={"wireframe": True})
    with warnings.catch_warnings(action="error"):  # the flag is the usual one again
        np.testing.assert_array_equal(physics.render(**size), physics.render(**size))
    with pytest.raises(ValueError, match=r"must be one of 'shadow', 'wireframe'.*, got 'lines'"):
        physics.render(**size, render_flag_overrides={"lines": True})


@pytest.mark.parametrize("make", KINDS)
@pytest.mark.parametrize("shown", ["depth", "segmentation"])
@pytest.mark.parametrize(
    "option", [{"overlays": ["text"]}, {"render_flag_overrides": {"shadow": False}}]
)
def test_colour_only_options_are_refused_with_depth_and_segmentation_as_in_dm_control(
    make: Any, shown: str, option: dict[str, Any]
) -> None:
    physics = make(MODEL)
    couple(physics, MATERIALS, **OPTIONS)
    with pytest.raises(
        ValueError, match=f"{next(iter(option))} are not supported with depth or segmentation"
    ):
        physics.render(24, 32, **{shown: True}, **option)


class Composed:
    """Like `dm_control.composer.Environment`: a new physics for each episode, with hooks."""

    def __init__(self) -> None:
        self.physics = StandIn(MODEL)
        self._hooks = []

    def add_extra_hook(self, name: str, hook: Any) -> None:
        assert name == "after_compile"
        self._hooks.append(hook)

    def reset(self) -> None:
        self.physics = StandIn(MODEL)
        for hook in self._hooks:
            hook(self.physics, np.random.RandomState(0))


def test_each_episode_of_a_composed_environment_ripples_anew() -> None:
    environment = Composed()
    ripples = couple(environment, MATERIALS, **OPTIONS)
    heights = []
    for _ in range(2):
        environment.reset()
        assert not ripples["block"].height.any()
        assert ripples.model is environment.physics.model.ptr
        environment.physics.step(100)
        heights.append(ripples["block"].height)
    assert heights[0].any()
    np.testing.assert_array_equal(*heights)
