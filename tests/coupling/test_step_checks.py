"""Warnings where impulses will be wrong: geoms too fast, solvers that stop too early."""

import warnings
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
import trimesh
from hits import contact_forces
from mujoco_models import BALL, mesh_asset, model_of

from ripple_sim import Material, Ripples, RippleWarning, Target, make_collidable
from ripple_sim.coupling import PAIR, CoupledModel, TunnellingCheck, too_fast, tunnelling
from ripple_sim.scenes.shapes import peanut

MASS = 1e-5
DT = 0.001


class Throw(NamedTuple):
    """A box thrown on a target: share of the force missing in its momentum, and warnings."""

    missing: float
    warnings: list[str]


def throw(solver: str, tolerance: float, target: float) -> Throw:
    """Throw a box on a target of a mass [kg]."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco>
        <option timestep="{DT}" tolerance="{tolerance}" solver="{solver}" iterations="1000"
        gravity="0 0 0"/>
        <worldbody><body><freejoint/><geom name="target" type="sphere" size="0.5" mass="{target}"/>
        </body>
        <body pos="0.1 0 0.54"><freejoint/><geom type="box" size="0.05 0.04 0.03" mass="{MASS}"/>
        </body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    missing = 0.0
    pressed = 0.0
    data.qvel[8] = -1.0
    with warnings.catch_warnings(record=True, action="always", category=RippleWarning) as caught:
        ripples = Ripples(model, {"target": Material(density=1.0)}, resolution=8, backend="cpu")
        for _ in range(150):
            before = data.qvel[6:9].copy()
            mujoco.mj_step(model, data)
            ripples.step(data)
            frames = data.contact.frame.reshape(-1, 3, 3)
            force = np.einsum("kij,ki->j", frames, contact_forces(model, data)[:, :3])
            pressed += np.linalg.norm(force) * DT
            missing += np.linalg.norm(MASS * (data.qvel[6:9] - before) - force * DT)
    messages = [str(warning.message) for warning in caught]
    return Throw(missing / pressed, [message for message in messages if "solver" in message])


@pytest.mark.parametrize("solver", ["Newton", "CG"])
def test_warning_about_a_solver_that_stops_too_early_and_its_advice_helps(solver: str) -> None:
    early = throw(solver, 1e-8, target=1e3)
    assert early.missing > 0.05
    [message] = early.warnings
    assert "the impulses on geom 'target' are wrong by about" in message
    assert "set option tolerance to 1e-14" in message
    advised = throw(solver, 1e-14, target=1e3)
    assert advised.missing < 1e-3
    assert not advised.warnings


@pytest.mark.parametrize("solver", ["Newton", "CG", "PGS"])
def test_no_warning_about_a_solver_that_has_converged(solver: str) -> None:
    converged = throw(solver, 1e-8, target=1e-2)
    assert converged.missing < 3e-3
    assert not converged.warnings


TREES = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
<geom name="still" size="0.1"/>
<body pos="1 0 0"><freejoint/><geom size="0.1" pos="0.2 0.1 0"/>
  <body pos="0.5 0 0"><joint type="hinge" axis="0 1 0"/>
  <geom type="box" size="0.1 0.2 0.1" pos="0 0 0.4"/>
    <body pos="0 0 0.5"><joint type="ball"/><geom type="capsule" size="0.1 0.2" pos="0.1 0.3 0"/>
    </body></body></body>
<body pos="-2 0 1"><joint type="slide" axis="0 0 1"/><geom size="0.2" pos="0 0.3 0"/></body>
</worldbody></mujoco>"""


def rows_of(pairs: np.ndarray) -> np.ndarray:
    """Pairs of geoms that count as near at any distance, and may not sink in."""
    return np.array([(*pair, 0.0, np.inf, 0.0) for pair in pairs], PAIR)


@pytest.mark.parametrize("seed", range(4))
def test_speeds_of_geoms_on_turning_trees_of_bodies_are_mujocos(seed: int) -> None:
    model = mujoco.MjModel.from_xml_string(TREES)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    mujoco.mj_integratePos(model, data.qpos, rng.uniform(-1, 1, model.nv), 1.0)
    forwards = rng.uniform(-3, 3, model.nv)
    pairs = np.argwhere(~np.eye(model.ngeom, dtype=bool))
    seen = []
    for data.qvel[:] in (forwards, -forwards):
        mujoco.mj_forward(model, data)
        velocities = np.zeros((model.ngeom, 6))
        for geom in range(model.ngeom):
            mujoco.mj_objectVelocity(
                model, data, mujoco.mjtObj.mjOBJ_GEOM, geom, velocities[geom], 0
            )
        apart = np.diff(data.geom_xpos[pairs], axis=1)[:, 0]
        relative = np.diff(velocities[pairs, 3:], axis=1)[:, 0]
        approaching = np.flatnonzero(np.einsum("ij,ij->i", apart, relative) < 0)
        rows, speeds = too_fast(rows_of(pairs), model, data, 5)
        np.testing.assert_array_equal(rows, approaching)
        np.testing.assert_allclose(speeds, np.linalg.norm(relative[rows], axis=1), rtol=1e-12)
        seen += rows.tolist()
    # each pair comes nearer in one of the two directions of time
    assert sorted(seen) == list(range(len(pairs)))
    data.cvel[:] = np.nan
    assert not len(too_fast(rows_of(pairs), model, data, 5)[0])
    assert not len(too_fast(rows_of(pairs[:0]), model, data, 5)[0])


# springs that throw back 0.9 of the speed
BOUNCY = "0.149 0.0335"
PLATE = '<geom name="plate" type="box" size="0.3 0.3 0.02"/>'
SHOT = '<body name="ball" pos="0 0 {}"><freejoint/><geom size="0.03"/></body>'


class Watched(NamedTuple):
    """A model, its data, and the check of its geom 0."""

    model: mujoco.MjModel
    data: mujoco.MjData
    check: TunnellingCheck


def watched(xml: str) -> Watched:
    """A model without gravity under the check."""
    model = mujoco.MjModel.from_xml_string(f'<mujoco><option gravity="0 0 0"/>{xml}</mujoco>')
    return Watched(model, mujoco.MjData(model), TunnellingCheck(CoupledModel(model), [0]))


class Shot(NamedTuple):
    """A ball shot at a plate: whether the plate throws it back, and the warnings."""

    bounced: bool
    warnings: list[str]


def shoot(speed: float, solref: str, timestep: float) -> Shot:
    """Shoot a ball at a plate."""
    model, data, check = watched(
        f"""<option timestep="{timestep}"/><default><geom solref="{solref}"/></default>
        <worldbody>{PLATE}{SHOT.format(0.6)}</worldbody>"""
    )
    data.qvel[2] = -speed
    with warnings.catch_warnings(record=True, action="always") as caught:
        for _ in range(int(1.2 / speed / timestep) + 200):
            mujoco.mj_step(model, data)
            check(data)
            if data.qvel[2] > 0:
                break
    messages = [str(warning.message) for warning in caught if warning.category is RippleWarning]
    return Shot(bool(data.qvel[2] > 0), messages)


@pytest.mark.parametrize("solref", ["0.02 1", "0.01 0.2", "0.004 1"])
def test_tunnelling_geoms_get_a_warning_and_slow_geoms_none(solref: str) -> None:
    speeds = np.geomspace(0.5, 120, 14)
    shots = [shoot(speed, solref, 0.002) for speed in speeds]
    assert all(shot.warnings for shot in shots if not shot.bounced)
    assert all(len(shot.warnings) <= 1 for shot in shots)
    first_warned = [bool(shot.warnings) for shot in shots].index(True)
    first_through = [shot.bounced for shot in shots].index(False)
    # not too late, and not so early that users ignore it: a factor of three in speed, and two of
    # the tried speeds to either side
    tries_in_factor_of_3 = np.log(3) / np.log(speeds[1] / speeds[0])
    assert 0 <= first_through - first_warned <= 2 + tries_in_factor_of_3


def test_warning_names_body_speed_and_a_time_step_that_suffices() -> None:
    bounced, [message] = shoot(20.0, "0.02 1", 0.002)
    assert not bounced
    assert "body 'ball' meets geom 'plate' at 20 m/s" in message
    timestep = float(message.split("time step of ")[-1].split()[0])
    assert timestep < 0.002
    assert "a solref of twice that" in message
    assert shoot(20.0, f"{2 * timestep} 1", timestep) == Shot(bounced=True, warnings=[])


def test_warning_names_a_solref_where_the_time_step_suffices() -> None:
    bounced, [message] = shoot(10.0, "0.02 1", 0.002)
    assert not bounced
    advice = message.split("; ")[-1]
    solref = advice.split('"')[1]
    assert advice == f'use a solref of "{solref}" or less for both'
    assert shoot(10.0, solref, 0.002) == Shot(bounced=True, warnings=[])


def test_a_warning_about_a_pair_is_repeated_only_if_it_gets_much_worse() -> None:
    ball = '<body name="{}" pos="{} 0 {}"><freejoint/><geom size="0.03"/></body>'
    balls = [("first", 0.0, 0.2, 10), ("as bad", 0.1, 0.9, 15), ("worse", 0.2, 2.0, 40)]
    xml = f"<worldbody>{PLATE}{''.join(ball.format(*each[:3]) for each in balls)}</worldbody>"
    model, data, check = watched(xml)
    data.qvel[2::6] = [-speed for *_, speed in balls]
    with warnings.catch_warnings(record=True, action="always") as caught:
        for _ in range(60):
            mujoco.mj_step(model, data)
            check(data)
    assert [str(each.message).split("'")[1] for each in caught] == ["first", "worse"]


def test_the_speed_is_relative_to_a_moving_target() -> None:
    model, data, check = watched(
        f"<worldbody><body><freejoint/>{PLATE}</body>{SHOT.format(0.2)}</worldbody>"
    )
    data.qvel[:6] = data.qvel[6:] = [0, 0, -30, 0, 0, 0]
    mujoco.mj_forward(model, data)
    with warnings.catch_warnings(action="error"):
        check(data)  # both fly along together
    data.qvel[2] = 15
    data.qvel[8] = -15
    mujoco.mj_forward(model, data)
    with pytest.warns(RippleWarning, match="at 30 m/s"):
        TunnellingCheck(CoupledModel(model), [0])(data)


@pytest.mark.parametrize("solref", ["0.02 1", "0.01 0.2", "0.149 0.0335"])
def test_warning_before_geoms_get_stuck_in_an_sdf(solref: str) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" gravity="0 0 0" sdf_initpoints="10"/>
        <default><geom solref="{solref}" condim="1"/></default>
        <asset>{mesh_asset("m", *peanut(0.05))}</asset><worldbody>
        <geom name="target" type="sdf" mesh="m"/><body name="ball" pos="-0.17 0.01 0.3"><freejoint/>
        <geom size="0.03" mass="0.3"/></body></worldbody></mujoco>"""
    )
    outcomes = []
    for speed in np.geomspace(1, 30, 8):
        data = mujoco.MjData(model)
        check = TunnellingCheck(CoupledModel(model), [0])
        data.qvel[2] = -speed
        forces = 0.0  # sum of the amounts of contact forces
        push = 0.0  # amount of their sum: less where some pull the geom in
        with warnings.catch_warnings(record=True, action="always") as caught:
            while data.time < 0.2 / speed + 0.06:
                mujoco.mj_step(model, data)
                check(data)
                normal = contact_forces(model, data)[:, 0]
                forces += normal.sum()
                push += float(np.linalg.norm(normal @ data.contact.frame.reshape(-1, 9)[:, :3]))
        outcomes.append((forces / push < 1.03, bool(caught)))
    assert all(warned for right, warned in outcomes if not right)
    # and not much too early: within two of the speeds tried
    first_wrong = [right for right, _ in outcomes].index(False)
    first_warned = [w for _, w in outcomes].index(True)
    assert first_wrong - first_warned <= 2


@pytest.mark.parametrize(
    ("kind", "solref"), [("sphere", "0.02 1"), ("sphere", BOUNCY), ("cylinder", BOUNCY)]
)
def test_warning_before_geoms_pass_a_flex_or_are_thrown_aside(kind: str, solref: str) -> None:
    slab = trimesh.creation.box(extents=(0.6, 0.6, 0.4))
    V, F = trimesh.remesh.subdivide_to_size(slab.vertices, slab.faces, 0.06)
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.002" gravity="0 0 0"/><default>
        <geom solref="{solref}" condim="3"/></default>
        <asset>{mesh_asset("m", V, F)}</asset><worldbody><geom name="slab" type="mesh" mesh="m"/>
        <body name="body" pos="-0.03 0.01 0.26"><freejoint/>
        <geom type="{kind}" size="0.05 0.04" mass="0.3"/></body>
        </worldbody></mujoco>"""
    )
    make_collidable(spec, "slab", "flex")
    model = spec.compile()
    right = []
    warned = []
    back = None
    for speed in np.geomspace(0.5, 60, 9):
        data = mujoco.MjData(model)
        check = TunnellingCheck(CoupledModel(model), [0])
        data.qvel[2] = -speed
        with warnings.catch_warnings(record=True, action="always") as caught:
            while data.time < 0.03 / speed + 0.06:
                mujoco.mj_step(model, data)
                check(data)
        back = data.qvel[2] / speed if back is None else back
        aside = np.linalg.norm([*data.qvel[:2], 0.05 * np.linalg.norm(data.qvel[3:])]) / speed
        right.append(abs(data.qvel[2] / speed - back) < 0.2 and aside < 0.5)
        warned.append(bool(caught))
    assert all(was_warned for ok, was_warned in zip(right, warned, strict=True) if not ok)
    # and not much too early: within a factor of six in speed
    assert 0 < right.index(False) - warned.index(True) + 1 <= 4


def test_speculative_contacts_turn_the_check_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flags = [
        flag for name, flag in mujoco.mjtEnableBit.__members__.items() if "SPECULATIVE" in name
    ]
    assert sum(int(flag) for flag in flags) == tunnelling.SPECULATIVE
    monkeypatch.setattr(tunnelling, "SPECULATIVE", 1 << 20)
    model, data, check = watched(f"<worldbody>{PLATE}{SHOT.format(0.2)}</worldbody>")
    data.qvel[2] = -60
    mujoco.mj_forward(model, data)
    with pytest.warns(RippleWarning, match="at 60 m/s"):
        check(data)
    model.opt.enableflags |= 1 << 20
    with warnings.catch_warnings(action="error"):
        TunnellingCheck(CoupledModel(model), [0])(data)


@pytest.mark.filterwarnings("ignore:geom 'shell' collides as 'core'")
def test_geoms_that_collide_for_a_target_are_watched() -> None:
    shell = '<geom name="shell" size="0.3" contype="0" conaffinity="0"/>'
    core = '<geom name="core" type="box" size="0.3 0.3 0.01"/>'
    model = model_of(f'<body name="link">{shell}{core}</body>' + BALL.format("0 0 0.5"))
    data = mujoco.MjData(model)
    data.qvel[2] = -80.0
    ripples = Ripples(model, {"shell": Target(contacts=["core"])}, resolution=8, backend="cpu")
    mujoco.mj_step(model, data)
    with pytest.warns(RippleWarning, match="body 'ball' meets geom 'core' at 80 m/s"):
        ripples.step(data)
