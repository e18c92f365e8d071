"""Bodies that are tied, driven, sticky or filtered: what a target gains is what its surface receives."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco_models import BALL, model_of

from ripple_sim import Material, Ripples

_SCRIPT = Path(__file__).parents[2] / "examples" / "benchmarks" / "momentum.py"
_spec = importlib.util.spec_from_file_location("momentum_cases", _SCRIPT)
momentum_cases = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(momentum_cases)


@pytest.mark.filterwarnings("ignore:the waves on geom")
@pytest.mark.parametrize("name", momentum_cases.CASES)
def test_what_a_plate_gains_is_what_its_surface_receives(name: str) -> None:
    gained, given = momentum_cases.measure(momentum_cases.CASES[name])
    assert gained > 0.1
    assert given == pytest.approx(gained, rel=0.01)


def two_balls() -> mujoco.MjModel:
    other = BALL.replace("ball", "other").format("-0.1 0 0.56")
    return model_of('<geom name="target" size="0.5"/>' + BALL.format("0.1 0 0.56") + other)


def test_contacts_that_a_users_filter_refuses_give_nothing() -> None:
    model = two_balls()
    data, refused = mujoco.MjData(model), model.geom("other").id
    ripples = Ripples(model, {"target": Material(density=1e3)}, resolution=8, backend="cpu")
    mujoco.set_mjcb_contactfilter(lambda m, d, one, other: int(refused in (one, other)))
    try:
        hits = []
        for _ in range(120):
            mujoco.mj_step(model, data)
            ripples.step(data)
            hits += ripples.last_impulses
    finally:
        mujoco.set_mjcb_contactfilter(None)
    assert {hit.other for hit in hits} == {"ball"}
    fallen = data.qvel[[2, 8]] + 9.81 * data.time
    assert fallen[1] == pytest.approx(0, abs=1e-9), "the other ball falls through"
    normal = np.array([0.1, 0, np.sqrt(0.55**2 - 0.01)]) / 0.55
    assert sum(hit.impulse for hit in hits) * normal[2] == pytest.approx(0.3 * fallen[0], rel=0.05)


def test_a_keyframe_begins_anew_and_counts_alone() -> None:
    spec = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="0.001"/><worldbody><geom name="target" size="0.5"/>'
        + BALL.format("0 0 0.6")
        + '</worldbody><keyframe><key qpos="0 0 0.55 1 0 0 0" qvel="0 0 -1 0 0 0"/></keyframe></mujoco>'
    )
    model = spec.compile()
    data, given = mujoco.MjData(model), 0.0
    ripples = Ripples(model, {"target": Material(density=1e3)}, resolution=8, backend="cpu", conserve_volume=False)
    for _ in range(150):
        mujoco.mj_step(model, data)
        ripples.step(data)
    assert ripples["target"].height.any()
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(60):
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(hit.impulse for hit in ripples.last_impulses)
    assert given == pytest.approx(0.3 * (data.qvel[2] + 1 + 9.81 * data.time), rel=1e-6)
    assert ripples["target"].momentum() == pytest.approx(-given, rel=1e-4)


def test_bodies_excluded_from_each_other_give_nothing() -> None:
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body name="base"><geom name="target" size="0.5"/></body>'
        + BALL.format("0 0 0.56")
        + BALL.replace("ball", "other").format("0 0.2 0.56")
        + '</worldbody><contact><exclude body1="base" body2="ball"/></contact></mujoco>'
    )
    model = spec.compile()
    data, others = mujoco.MjData(model), set()
    ripples = Ripples(model, {"target": Material(density=1e3)}, resolution=8, backend="cpu")
    for _ in range(60):
        mujoco.mj_step(model, data)
        ripples.step(data)
        others |= {hit.other for hit in ripples.last_impulses}
    assert others == {"other"}
