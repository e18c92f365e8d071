"""dm_control's `Physics` ripples, though it ends its steps with the beginning of the next one."""

import importlib.util
import warnings
from typing import Any

import mujoco
import numpy as np
import pytest
from stand_in_physics import StandIn

from ripple_sim import Material, RippleRenderer, Ripples, RippleWarning
from ripple_sim.dm_control import couple

MASS, GRAVITY = 0.3, 9.81
MODEL = f"""<mujoco><option timestep="0.002"/><worldbody>
<geom name="block" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1" solref="0.01 0.3"/>
<body name="ball" pos="0.03 0.02 0.06"><freejoint/><geom size="0.05" mass="{MASS}" solref="0.01 0.3"/></body>
</worldbody></mujoco>"""
MATERIALS = {"block": Material(speed=1.0, density=100.0)}
OPTIONS: dict[str, Any] = {"resolution": 16, "backend": "cpu"}


def dm_control_physics() -> Any:
    from dm_control.mujoco import Physics

    return Physics.from_xml_string(MODEL)


# the stand-in everywhere, and the package itself where it is installed
def stand_in() -> StandIn:
    return StandIn(MODEL)


KINDS = [stand_in, *([dm_control_physics] if importlib.util.find_spec("dm_control") else [])]


@pytest.mark.parametrize("make", KINDS)
@pytest.mark.parametrize("legacy", [True, False])
def test_each_physics_step_counts(make: Any, legacy: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    physics = make()
    physics.legacy_step = legacy
    ripples = couple(physics, MATERIALS, **OPTIONS)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, plain = mujoco.MjData(model), Ripples(model, MATERIALS, **OPTIONS)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RippleWarning)
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


def test_its_wrappers_are_drawn_as_they_are() -> None:
    physics = StandIn(MODEL)
    ripples = couple(physics, MATERIALS, **OPTIONS)
    frame = RippleRenderer(physics.model, ripples, width=32, height=24).render(physics.data)
    assert frame.shape == (24, 32, 3)
