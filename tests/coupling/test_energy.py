"""Bodies and waves gain no energy in contact, and bodies rest where they should."""

import copy
import warnings

import mujoco
import numpy as np
import pytest
from hits import Run

from ripple_sim import Material, RippleWarning
from ripple_sim.coupling import VelocityChange

GRAVITY = 9.81
CONTACTS = {"default": "", "undamped": 'solref="-10000 0"', "bouncy": 'solref="0.02 0.2"'}
GEOMS = {
    "sphere": 'size="0.06"',
    "capsule": 'size="0.05 0.05" euler="20 80 0"',
    "box": 'size="0.06 0.05 0.04" euler="10 20 0"',
    "cube": 'size="0.06 0.06 0.06"',
}
TARGETS = {
    "fixed": "",
    "slide": '<joint type="slide" axis="0 0 1" stiffness="2e4"/>',
    "free": "<freejoint/>",
}


def scene(
    kind: str,
    mass: float,
    dt: float,
    fall: float,
    contact: str = "",
    joint: str = "",
    cone: str = "pyramidal",
):
    """A body above a box; over a free one it flies down without gravity."""
    gravity = 0.0 if "free" in joint else -GRAVITY
    geom = f'type="{"box" if kind == "cube" else kind}" {GEOMS[kind]} mass="{mass}"'
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" cone="{cone}" gravity="0 0 {gravity}"/><default>
        <geom {contact}/></default>
        <worldbody><body>{joint}<geom name="target" type="box" size="0.5 0.5 0.1" mass="20"/></body>
        <body pos="0.03 0.02 {0.1 + fall}"><freejoint/><geom {geom}/></body>
        </worldbody></mujoco>"""
    )


def coupled(model: mujoco.MjModel, material: Material, conserve_volume: bool = True) -> Run:
    return Run(
        model,
        "target",
        material=material,
        resolution=16,
        two_way=True,
        conserve_volume=conserve_volume,
    )


@pytest.mark.parametrize("seed", range(8))
def test_energy_of_bodies_and_waves_never_rises(seed: int) -> None:
    rng = np.random.default_rng(seed)
    dt = rng.uniform(1e-3, 4e-3)
    mass = 10 ** rng.uniform(-3, 3)
    fall = rng.uniform(0.15, 0.4)
    kind = str(rng.choice(list(GEOMS)))
    joint = str(rng.choice(list(TARGETS)))
    contact = CONTACTS[str(rng.choice(list(CONTACTS)))]
    model = scene(
        kind, mass, dt, fall, contact, TARGETS[joint], str(rng.choice(["pyramidal", "elliptic"]))
    )
    stiffness = float(rng.choice([0.0, (rng.uniform(0, 1) / dt) ** 2]))
    material = (
        Material()
        if seed % 3 == 0
        else Material(1.0, 0.0, stiffness, density=float(10 ** rng.uniform(0, 4)))
    )
    # of waves that are too high
    with warnings.catch_warnings(action="ignore", category=RippleWarning):
        run = coupled(model, material)
        run.data.qvel[-4] = -1.0
        paid = mass * (GRAVITY * fall + 0.5)
        largest = run.ripples.energy(run.data).total
        touched = False
        for _ in range(round(0.3 / dt)):
            run.step()
            touched |= bool(run.data.ncon)
            total = run.ripples.energy(run.data).total
            assert total <= largest + 0.01 * paid
            largest = max(largest, total)
    assert touched


@pytest.mark.parametrize(
    ("mass", "dt", "kind"), [(5, 0.002, "sphere"), (20, 0.001, "sphere"), (20, 0.002, "cube")]
)
def test_a_body_laid_at_rest_stays_in_its_dimple(mass: float, dt: float, kind: str) -> None:
    model = scene(kind, mass, dt, 0.06 - 1e-4)
    run = coupled(model, Material())
    rigid = mujoco.MjData(model)
    given = []
    for _ in range(round(0.6 / dt)):
        given.append(sum(hit.impulse for hit in run.step()))
        mujoco.mj_step(model, rigid)
        assert run.data.qpos[2] < model.body_pos[2, 2] + 5e-4
    dimple = float(run.ripples["target"].height.min())
    assert rigid.qpos[2] + dimple - 5e-4 < run.data.qpos[2] < rigid.qpos[2] + 5e-4
    # and the surface bears the weight
    assert np.mean(given[len(given) // 2 :]) == pytest.approx(mass * GRAVITY * dt, rel=1e-2)


def test_a_ball_gives_its_energy_to_waves_without_damping() -> None:
    """An undamped contact loses no energy: the bounce is lower by the energy of the waves."""
    run = coupled(
        scene("sphere", 0.5, 0.0005, 0.3, 'solref="-20000 0"'),
        Material(1.0, 0.0, 3e4, density=1000.0),
    )
    before = run.ripples.energy(run.data).total
    run.until(0.45)
    energy = run.ripples.energy(run.data)
    paid = 0.5 * GRAVITY * 0.24
    assert energy.waves > 0.01 * paid
    # nothing is gained or lost but by the waves' single precision, whose sign is chance
    assert energy.total == pytest.approx(before, abs=2e-6 * energy.waves)


def test_ledger_of_a_free_fall_is_exact() -> None:
    run = coupled(scene("sphere", 2.0, 0.002, 0.5), Material())
    start = run.ripples.energy(run.data)
    end = run.ripples.energy(run.until(0.2).data)
    assert end.bodies == pytest.approx(start.bodies, rel=1e-12)
    assert end.waves == 0


def test_the_surface_gains_the_momentum_that_the_body_loses() -> None:
    model = scene("box", 0.7, 0.001, 0.3, cone="elliptic")
    run = coupled(model, Material(1.0, 0.0, 0.0, density=500.0), conserve_volume=False).until(0.5)
    assert run.given() > 0.5
    assert run.given() == pytest.approx(
        0.7 * (run.data.qvel[2] + GRAVITY * run.data.time), rel=1e-6
    )
    assert run.ripples["target"].momentum() == pytest.approx(-run.given(), rel=1e-4)


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
def test_taking_contact_forces_back_gives_the_velocities_of_a_step_without_them(
    integrator: str,
) -> None:
    """Of a body that spins, over a hinge with damping, when its contact forces are taken back."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" integrator="{integrator}"/><worldbody>
        <body pos="0.4 0 0"><joint axis="0 1 0" damping="5"/>
        <geom type="box" size="0.5 0.5 0.1" mass="20"/></body>
        <body pos="0 0 0.147"><freejoint/><geom type="box" size="0.1 0.08 0.05" mass="3"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qvel[:] = 0.3, 0.5, -0.4, -5.0, 20.0, -10.0, 30.0
    free = copy.copy(data)
    mujoco.mj_step(model, data)
    assert data.ncon
    assert np.abs(data.qfrc_constraint).max() > 100
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    mujoco.mj_step(model, free)
    old = data.qacc.copy(), data.qfrc_constraint.copy()
    data.qacc = free.qacc
    data.qfrc_constraint = free.qfrc_constraint
    change = VelocityChange(model)(data, *old, pending=False)
    np.testing.assert_allclose(data.qvel + change, free.qvel, atol=1e-5 * np.abs(change).max())
