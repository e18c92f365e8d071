"""What the surface gets is what the bodies lose: for every shape, route, restitution, time step and frame rate."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco_models import mesh_asset

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.errors import RippleWarning
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scenes.shapes import limbed, peanut
from ripple_sim.simulation import Simulation

GRAVITY = np.array([0, 0, -9.81])
MASS = 0.3
BODIES = {
    "sphere": 'size="0.05"',
    "box": 'type="box" size="0.06 0.05 0.04"',
    "capsule": 'type="capsule" size="0.03 0.05" euler="90 0 0"',
    "cylinder": 'type="cylinder" size="0.05 0.03"',
    "ellipsoid": 'type="ellipsoid" size="0.07 0.06 0.04"',
    "mesh": 'type="mesh" mesh="pebble"',
}
TARGETS = {
    "sphere": ('type="sphere" size="0.5"', 0.5),
    "box": ('type="box" size="0.5 0.5 0.2"', 0.2),
    "capsule": ('type="capsule" size="0.3 0.2"', 0.5),
    "ellipsoid": ('type="ellipsoid" size="0.5 0.4 0.3"', 0.3),
    "cylinder": ('type="cylinder" size="0.4 0.2"', 0.2),
    "sdf": ('type="sdf" mesh="animal"', 0.45),
    "flex": ('type="mesh" mesh="animal"', 0.45),
    "hull": ('type="mesh" mesh="animal"', 0.61),
}
# contact springs of 200 rad/s that throw back with about this share of the speed
SOLREF = {0.0: "0.02 1", 0.5: "0.023 0.215", 0.9: "0.149 0.0335"}


@pytest.fixture(scope="module")
def assets() -> str:
    V, F = peanut(0.06)
    pebble = 0.05 * V / np.linalg.norm(V, axis=1, keepdims=True)
    return mesh_asset("animal", *limbed(0.04)) + mesh_asset("pebble", pebble, F)


def drop(
    assets: str, target: str, body: str, restitution: float, joint: str = "", cone: str = "pyramidal", condim: int = 1
) -> tuple[float, float, float, float]:
    """Sum of impulses, the body's change of momentum, the surface's momentum, and the coefficient of restitution."""
    geom, top = TARGETS[target]
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.002" sdf_initpoints="10" cone="{cone}"/>
        <default><geom solref="{SOLREF[restitution]}" condim="{condim}"/></default><asset>{assets}</asset>
        <worldbody><body name="body" pos="-0.03 0 {top + 0.25}"><freejoint/>
        <geom {BODIES[body]} mass="{MASS}"/></body><body>{joint}<geom name="target" {geom} mass="3"/></body></worldbody>
        </mujoco>"""
    )
    if target == "flex":
        make_collidable(spec, "target", "flex")
    if joint:
        # a target that may move must not fall
        spec.option.gravity = [0, 0, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[2] = -2.2 if joint else 0.0
    ripples = Ripples(model, {"target": Material(density=50)}, resolution=12, backend="cpu", conserve_volume=False)
    given, change, first, after, contact = 0.0, np.zeros(3), None, np.zeros(3), 0.0
    while data.time < 0.6:
        before = data.qvel[:3].copy()
        mujoco.mj_step(model, data)
        ripples.step(data)
        if ripples.last_impulses:
            first = before if first is None else first
            contact, after = data.time, data.qvel[:3].copy()
            given += sum(impulse.impulse for impulse in ripples.last_impulses)
            change += MASS * (data.qvel[:3] - before - model.opt.gravity * model.opt.timestep)
        elif first is not None and data.time - contact > 0.02:
            break
    assert first is not None
    return given, float(np.linalg.norm(change)), ripples["target"].momentum(), float(-after[2] / first[2])


@pytest.mark.filterwarnings("ignore:geom 'target' collides", "ignore:body 'body' meets geom 'target'")
@pytest.mark.parametrize("restitution", SOLREF)
@pytest.mark.parametrize(
    ("target", "body"),
    [*((target, "sphere") for target in TARGETS), *(("sdf", body) for body in BODIES), ("box", "box"), ("hull", "box")]
    + [("flex", body) for body in BODIES],
)
def test_impulses_are_the_bodys_change_of_momentum(assets: str, target: str, body: str, restitution: float) -> None:
    given, change, surface, _ = drop(assets, target, body, restitution)
    assert given == pytest.approx(change, rel=0.03)
    # there is a little deficit under a body that stays, and none under one that has bounced off
    assert surface == pytest.approx(-given, rel=0.03 if restitution == 0 else 1e-5)


@pytest.mark.filterwarnings("ignore:geom 'target' collides", "ignore:body 'body' meets geom 'target'")
@pytest.mark.parametrize("restitution", [0.0, 0.9])
@pytest.mark.parametrize("body", ["capsule", "box", "cylinder"])
@pytest.mark.parametrize(
    ("joint", "cone", "condim"),
    [
        ("<freejoint/>", "pyramidal", 1),
        ('<joint axis="0 1 0" pos="0.4 0 0" damping="0.2" stiffness="40"/>', "elliptic", 3),
        ("", "elliptic", 3),
        ("", "pyramidal", 3),
    ],
    ids=["free", "hinge", "elliptic", "pyramidal"],
)
def test_flex_that_moves_or_has_friction_gets_what_the_body_loses(
    assets: str, body: str, restitution: float, joint: str, cone: str, condim: int
) -> None:
    given, change, surface, _ = drop(assets, "flex", body, restitution, joint, cone, condim)
    assert given == pytest.approx(change, rel=0.03)
    assert surface == pytest.approx(-given, rel=0.03 if restitution == 0 else 1e-5)


def test_springs_throw_back_as_they_promise(assets: str) -> None:
    rebounds = [drop(assets, "sphere", "sphere", restitution)[3] for restitution in SOLREF]
    np.testing.assert_allclose(rebounds, list(SOLREF), atol=0.1)


def first_crest(model: mujoco.MjModel, seconds: float = 0.75) -> tuple[float, float, float]:
    """Momentum that the surface gained and that the ball lost, and when the crest is 0.7 rad from the hit [s]."""
    data = mujoco.MjData(model)
    material = Material(speed=1.0, density=50.0)
    ripples = Ripples(model, {"target": material}, resolution=32, backend="cpu", conserve_volume=False)
    waves = ripples["target"]
    texel = int(waves.atlas.nearest_texel(0.5 * np.array([np.sin(0.7), 0.0, np.cos(0.7)]))[0])
    times, heights = [], []
    while data.time < seconds - 1e-9:
        mujoco.mj_step(model, data)
        ripples.step(data)
        times.append(waves.time)
        heights.append(waves.height.flat[texel])
    lost = MASS * (data.qvel[2] - GRAVITY[2] * data.time)
    return -waves.momentum(), lost, _extremum(np.array(times), np.array(heights))


def _extremum(times: np.ndarray, heights: np.ndarray) -> float:
    i = int(np.argmin(heights))
    a, b, c = heights[i - 1 : i + 2].astype(np.float64)
    return float(times[i] + (times[i] - times[i - 1]) * (a - c) / (a - 2 * b + c) / 2)


def ball_on_sphere(timestep: float, solref: str, integrator: str = "Euler") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{timestep}" integrator="{integrator}"/>
        <default><geom solref="{solref}"/></default><worldbody><geom name="target" type="sphere" size="0.5"/>
        <body pos="0 0 0.8"><freejoint/><geom size="0.05" mass="{MASS}"/></body></worldbody></mujoco>"""
    )


@pytest.mark.parametrize("restitution", SOLREF)
def test_answer_does_not_depend_on_the_physics_time_step(restitution: float) -> None:
    """Up to MuJoCo's own springs: under-damped ones, at 4 ms, throw the ball back 7 % slower than at 1 ms."""
    results = [first_crest(ball_on_sphere(dt, SOLREF[restitution])) for dt in (0.004, 0.002, 0.001)]
    momenta, lost, arrivals = np.array(results).T
    np.testing.assert_allclose(momenta, lost, rtol=0.015)
    np.testing.assert_allclose(momenta / lost, momenta[-1] / lost[-1], rtol=0.01)
    np.testing.assert_allclose(arrivals, arrivals[-1], rtol=0.01)
    if restitution != 0.5:
        np.testing.assert_allclose(momenta, momenta[-1], rtol=0.03)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_integrators_that_hold_their_forces_agree(integrator: str) -> None:
    gained, lost, _ = first_crest(ball_on_sphere(0.002, SOLREF[0.5], integrator))
    assert gained == pytest.approx(lost, rel=1e-4)


def test_integrator_that_does_not_is_warned_of() -> None:
    with pytest.warns(RippleWarning, match='RK4 .* integrator="implicitfast"'):
        Ripples(ball_on_sphere(0.002, SOLREF[0.5], "RK4"), {"target": Material()}, resolution=8, backend="cpu")


def test_answer_does_not_depend_on_the_frame_rate(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(
        """<mujoco><option timestep="0.002"/><worldbody><geom name="target" type="sphere" size="0.5"/>
        <body pos="0 0 0.8"><freejoint/><geom size="0.05" mass="0.3"/></body></worldbody></mujoco>"""
    )
    (tmp_path / "scene.toml").write_text(
        'model = "scene.xml"\n[[ripple]]\ngeom = "target"\nresolution = 32\nmaterial = {density = 50.0}\n'
    )
    scene = load_scene(tmp_path / "scene.toml")
    given, arrivals = [], []
    for fps in (24, 60, 100):
        simulation, total, record = Simulation(scene, fps=fps, backend="cpu"), 0.0, []
        waves = simulation.ripples["target"]
        texel = int(waves.atlas.nearest_texel(0.5 * np.array([np.sin(0.7), 0.0, np.cos(0.7)]))[0])
        while simulation.data.time < 0.75 - 1e-9:
            simulation.advance_frame()
            total += sum(impulse.impulse for impulse in simulation.impulses)
            record.append((waves.time, waves.height.flat[texel]))
        times, crest = np.array(record).T
        given.append(total)
        arrivals.append(_extremum(times, crest))
    np.testing.assert_allclose(given, given[-1], rtol=0.03)
    np.testing.assert_allclose(arrivals, arrivals[-1], rtol=0.01)
