"""Bodies that come to rest: the surface becomes still, and bears their weight."""

import mujoco
import numpy as np
import pytest
from mujoco_models import limbed_asset
from unfiltered import WithAndWithout, rms

from ripple_sim import Material, Ripples, make_collidable

GRAVITY = 9.81
# of the softest material that still becomes still within a few seconds
MATERIAL = Material(speed=0.6, damping=5.0, stiffness=1000.0, viscosity=3e-4, density=100.0)


TARGETS = {
    "sphere": ('<geom name="target" type="sphere" size="2" pos="0 0 -2"/>', 0.0),
    "box": ('<geom name="target" type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"/>', 0.0),
    "animal": ('<geom name="target" type="sdf" mesh="limbed" pos="0.03 0 -0.446"/>', 0.01),
    "flex": ('<geom name="target" type="mesh" mesh="limbed" pos="0.03 0 -0.446"/>', 0.01),
}


BODIES = {
    "ball": 'type="sphere" size="0.05"',
    "box": 'type="box" size="0.06 0.05 0.04"',
    "capsule": 'type="capsule" size="0.03 0.05" euler="90 0 0"',
}


def model_of(target: str, body: str, solref: str) -> mujoco.MjModel:
    geom, top = TARGETS[target]
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.002" sdf_initpoints="10"/>
        <default><geom solref="{solref}" friction="1 0.05 0.05" condim="6"/></default>
        <asset>{limbed_asset()}</asset>
        <worldbody>{geom}<body name="body" pos="0 0 {top + 0.2}"><freejoint/><geom {BODIES[body]} mass="0.5"/></body>
        </worldbody></mujoco>"""
    )
    if target == "flex":
        make_collidable(spec, "target", "flex")
    return spec.compile()


pytestmark = pytest.mark.filterwarnings("ignore:geom 'target' collides through a flex", "ignore:the waves on geom")


# solref 0.01 0.2 never comes quite to rest: contacts of flat bodies break and close at every other step
@pytest.mark.parametrize("solref", ["0.02 1", "0.01 0.2"])
@pytest.mark.parametrize(
    ("target", "body"),
    [("sphere", "ball"), ("box", "box"), ("box", "capsule"), ("animal", "box"), ("flex", "box")],
)
def test_surface_under_a_body_at_rest_becomes_still_in_its_dimple(target: str, body: str, solref: str) -> None:
    model = model_of(target, body, solref)
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": MATERIAL}, resolution=24, backend="cpu", conserve_volume=False)
    waves, after_impact = ripples["target"], 0.0
    while data.time < 5:
        mujoco.mj_step(model, data)
        ripples.step(data)
        if data.time < 0.5:
            after_impact = max(after_impact, rms(waves))
    assert rms(waves) < 0.001 * after_impact
    # the springs under the whole surface bear the weight
    support = -(waves.operator.mass * MATERIAL.stiffness * waves.height.astype(np.float64)).sum()
    # ... of which the slope of the animal's back takes a little along the surface
    assert support == pytest.approx(0.5 * GRAVITY, rel=0.02 if target in ("animal", "flex") else 0.005)
    deepest = waves.atlas.positions.reshape(-1, 3)[waves.height.argmin()]
    position, rotation = data.geom("target").xpos, data.geom("target").xmat.reshape(3, 3)
    assert np.linalg.norm(position + rotation @ deepest - data.body("body").xpos) < 0.12


def test_box_that_lies_flat_loads_the_surface_under_its_middle_too() -> None:
    model = model_of("box", "box", "0.02 1")
    data = mujoco.MjData(model)
    material = Material(speed=0.1, damping=20.0, stiffness=1000.0, density=100.0)
    ripples = Ripples(model, {"target": material}, resolution=64, backend="cpu")
    while data.time < 1.5:
        mujoco.mj_step(model, data)
        ripples.step(data)
    waves = ripples["target"]
    place, height = waves.atlas.positions.reshape(-1, 3), waves.height.reshape(-1)
    above = place[:, 2] > 0.099
    middle = above & (np.hypot(place[:, 0], place[:, 1]) < 0.015)
    corner = above & (np.abs(np.abs(place[:, 0]) - 0.06) < 0.012) & (np.abs(np.abs(place[:, 1]) - 0.05) < 0.012)
    away = above & (np.hypot(place[:, 0], place[:, 1]) > 0.2)
    assert height[middle].max() < 0
    assert height[middle].mean() < height[corner].mean() < 0
    assert np.abs(height[away]).max() < 0.02 * np.abs(height[middle]).max()


@pytest.mark.parametrize(("target", "dt"), [("animal", 0.004), ("box", 0.002)])
def test_surface_under_a_stack_and_its_neighbours_becomes_still(target: str, dt: float) -> None:
    _, top = TARGETS[target]
    places = [
        ("box", 0.0, 0.1),
        ("box", 0.0, 0.2),
        *([("capsule", -0.3, 0.05), ("ball", 0.3, 0.06)] * (target == "box")),
    ]
    bodies = "".join(
        f'<body pos="{x} 0 {top + z}"><freejoint/><geom {BODIES[kind]} mass="0.5"/></body>' for kind, x, z in places
    )
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" sdf_initpoints="10"/><default><geom friction="1 0.05 0.05" condim="6"/>
        </default><asset>{limbed_asset()}</asset><worldbody>{TARGETS[target][0]}{bodies}</worldbody></mujoco>"""
    )
    data, history = mujoco.MjData(model), []
    ripples = Ripples(model, {"target": MATERIAL}, resolution=16, backend="cpu", conserve_volume=False)
    while data.time < 5:
        mujoco.mj_step(model, data)
        ripples.step(data)
        history.append(rms(ripples["target"]))
    assert len(ripples.last_impulses) == len(places) - 1
    assert max(history[-50:]) < 0.001 * max(history)


def hammered(target: str, off: float) -> mujoco.MjModel:
    """A block that rests on a target, and a hammer held above it, so far off its middle [m]."""
    geom, top = TARGETS[target]
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" sdf_initpoints="10"/>
        <default><geom friction="1 0.05 0.05" condim="6"/></default><asset>{limbed_asset()}</asset><worldbody>{geom}
        <body name="body" pos="0 0 {top + 0.041}"><freejoint/><geom {BODIES["box"]} mass="0.5" conaffinity="3"/></body>
        <body name="hammer" pos="{off} 0 {top + 0.5}" gravcomp="1"><joint name="hammer" type="slide" axis="0 0 1"/>
        <geom size="0.03" mass="1" contype="2" conaffinity="2"/></body></worldbody></mujoco>"""
    )


@pytest.mark.parametrize("rest", [0.05, 0.2, 2.0])
@pytest.mark.parametrize(("target", "off", "speed"), [("box", 0.03, 3.0), ("box", 0.0, 0.2), ("animal", 0.03, 3.0)])
def test_a_hit_makes_the_same_wave_after_any_rest(target: str, off: float, speed: float, rest: float) -> None:
    model = hammered(target, off)
    data, waves = mujoco.MjData(model), WithAndWithout(model, MATERIAL, 12)
    hammer, struck = model.joint("hammer"), False
    while data.time < rest + 0.2:
        if data.time >= rest and not struck:
            above = data.body("body").xpos[2] + 0.04 + 0.03 + 0.002
            data.qpos[hammer.qposadr], data.qvel[hammer.dofadr] = above - model.body("hammer").pos[2], -speed
            struck = True
        mujoco.mj_step(model, data)
        waves.step(data)
    filtered, unfiltered = np.array(waves.history)[round(rest / 0.002) :].max(axis=0)
    assert filtered == pytest.approx(unfiltered, rel=0.03)


@pytest.mark.parametrize(("frequency", "dt"), [(0.5, 0.004), (5.0, 0.002), (50.0, 0.002), (50.0, 0.004)])
def test_a_rod_that_stays_in_contact_drives_waves_for_ever(frequency: float, dt: float) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}"/><worldbody>{TARGETS["sphere"][0]}
        <body pos="0 0 0.06"><joint name="rod" type="slide" axis="0 0 1"/><geom type="capsule" size="0.03 0.03"
        mass="1"/></body></worldbody><actuator><motor joint="rod"/></actuator></mujoco>"""
    )
    data, waves = mujoco.MjData(model), WithAndWithout(model, MATERIAL, 8)
    while data.time < 6:
        data.ctrl[0] = 0.8 * GRAVITY * np.sin(2 * np.pi * frequency * data.time)
        mujoco.mj_step(model, data)
        waves.step(data)
    assert np.shape(data.contact.geom) == (1, 2)
    late = np.array(waves.history)[-round(2 / dt) :]
    np.testing.assert_allclose(*np.sqrt((late**2).mean(axis=0)), rtol=0.01)
    # the wave of the height at the time, not of its amount alone
    np.testing.assert_allclose(waves.filtered.height, waves.unfiltered.height, atol=0.01 * late.max())


def test_a_body_that_rolls_slowly_leaves_a_calm_surface() -> None:
    """Its footprint is made anew at every third of a texel, which makes noise without the filter."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.002"/><worldbody><geom name="target" type="box" size="0.4 0.2 0.1"/>
        <body pos="-0.1 0 0.15"><freejoint/><geom size="0.05" mass="0.5"/></body></worldbody></mujoco>"""
    )
    data, waves = mujoco.MjData(model), WithAndWithout(model, MATERIAL, 24)
    data.qvel[[0, 4]] = 0.05, 1.0
    while data.time < 3:
        mujoco.mj_step(model, data)
        waves.step(data)
    filtered, unfiltered = np.array(waves.history)[-500:].max(axis=0)
    assert filtered < 0.5 * unfiltered
    # it is where the body is
    deepest = waves.filtered.atlas.positions.reshape(-1, 3)[waves.filtered.height.argmin()]
    assert np.linalg.norm(deepest[:2] - data.qpos[:2]) < 0.05
