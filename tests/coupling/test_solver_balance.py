"""Where MuJoCo's solver stops too early, impulses and momentum disagree, and a warning says so."""

import warnings

import mujoco
import numpy as np
import pytest

from ripple_sim import Material, Ripples
from ripple_sim.errors import RippleWarning

MASS, DT = 1e-5, 0.001


def throw(solver: str, tolerance: float, target: float) -> tuple[float, list[str]]:
    """Share of a box's contact forces on a target of a mass [kg] that its momentum does not show, and warnings."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{DT}" tolerance="{tolerance}" solver="{solver}" iterations="1000"
        gravity="0 0 0"/>
        <worldbody><body><freejoint/><geom name="target" type="sphere" size="0.5" mass="{target}"/></body>
        <body pos="0.1 0 0.54"><freejoint/><geom type="box" size="0.05 0.04 0.03" mass="{MASS}"/></body>
        </worldbody></mujoco>"""
    )
    data, wrench, missing, pressed = mujoco.MjData(model), np.zeros(6), 0.0, 0.0
    data.qvel[8] = -1.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RippleWarning)
        ripples = Ripples(model, {"target": Material(density=1.0)}, resolution=8, backend="cpu")
        for _ in range(150):
            before = data.qvel[6:9].copy()
            mujoco.mj_step(model, data)
            ripples.step(data)
            force = np.zeros(3)
            for i, contact in enumerate(data.contact):
                mujoco.mj_contactForce(model, data, i, wrench)
                force += contact.frame.reshape(3, 3).T @ wrench[:3]
            pressed += np.linalg.norm(force) * DT
            missing += np.linalg.norm(MASS * (data.qvel[6:9] - before) - force * DT)
    return missing / pressed, [str(warning.message) for warning in caught if "solver" in str(warning.message)]


@pytest.mark.parametrize("solver", ["Newton", "CG"])
def test_a_solver_that_stops_too_early_is_warned_of_and_the_advice_helps(solver: str) -> None:
    missing, messages = throw(solver, 1e-8, target=1e3)
    assert missing > 0.05
    assert len(messages) == 1
    assert "the impulses on geom 'target' are wrong by about" in messages[0]
    assert "set option tolerance to 1e-14" in messages[0]
    missing, messages = throw(solver, 1e-14, target=1e3)
    assert missing < 1e-3
    assert not messages


@pytest.mark.parametrize("solver", ["Newton", "CG", "PGS"])
def test_a_solver_that_has_converged_is_not_warned_of(solver: str) -> None:
    missing, messages = throw(solver, 1e-8, target=1e-2)
    assert missing < 3e-3
    assert not messages
