"""Soft flexes load a surface as geoms do: whole force, by vertex, under the flex's name."""

import mujoco
import numpy as np
import pytest
from hits import Run, contact_forces
from mujoco_models import mesh_asset

from ripple_sim import Material, Ripples, RippleWarning, make_collidable
from ripple_sim.scenes.shapes import limbed

MASS = 0.5
DT = 0.002
BOX = '<geom name="target" type="box" size="0.4 0.4 0.2"/>'
SEEN = 'contype="0" conaffinity="0"'


def draped(
    target: str, body: str = "", contact: str = "", kind: str = "2", integrator: str = "Euler"
):
    """A cloth of 0.4 m, or a soft cube, over a target whose top is at 0.2 m."""
    count = "11 11 1" if kind == "2" else "4 4 4"
    # the discrete integrator of MuJoCo 4 refuses damped edges
    damping = "" if integrator == "discrete" else 'damping="0.01"'
    edge = (
        f'<edge equality="true" {damping}/>'
        if kind == "2"
        else '<elasticity young="2e4" poisson="0.2"/>'
    )
    return mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="{DT}" solver="CG" tolerance="1e-6" integrator="{integrator}"/>
        <asset>{mesh_asset("animal", *limbed(0.05))}</asset><worldbody>
        <body name="link">{body}{target}</body>
        <flexcomp name="cloth" type="grid" count="{count}" spacing="0.04 0.04 0.04"
          pos="0.03 0 0.3" dim="{kind}"
          mass="{MASS}" radius="0.005">{edge}
        <contact selfcollide="none" condim="1" solref="0.01 1" {contact}/></flexcomp>
        </worldbody></mujoco>"""
    )


def play(spec: mujoco.MjSpec, seconds: float) -> tuple[Run, float]:
    """The run, and the sum of MuJoCo's normal forces times time step [N s]."""
    run = Run(spec, "target", resolution=24)
    told = 0.0
    while run.data.time < seconds - 1e-9:
        run.step()
        told += contact_forces(run.model, run.data)[:, 0].sum() * DT
    return run, told


@pytest.mark.parametrize("kind", ["2", "3"])
def test_soft_bodies_give_a_flat_top_their_whole_momentum(kind: str) -> None:
    """37,103 contacts of a cloth once gave nothing."""
    run, told = play(draped(BOX, kind=kind), 0.3)
    assert run.pairs == {("target", "cloth")}
    assert max(map(len, run.hits)) == 1, "one record a step"
    velocity = run.data.qvel.reshape(-1, 3)[:, 2].mean()
    assert run.given() == pytest.approx(MASS * (velocity + 9.81 * run.data.time), rel=0.01)
    assert run.given() == pytest.approx(told, rel=1e-6)
    assert -run.ripples["target"].momentum() == pytest.approx(run.given(), rel=0.01)
    while not run.hits[-1] and run.data.time < 0.5:
        run.step()
    middle = np.average(
        run.data.contact.pos, axis=0, weights=contact_forces(run.model, run.data)[:, 0]
    )
    np.testing.assert_allclose(run.hits[-1][0].point, [*middle[:2], 0.2], atol=1e-6)


def test_cloth_presses_evenly_where_it_lies() -> None:
    waves = play(draped(BOX), 0.16)[0].ripples["target"]
    positions = waves.atlas.positions
    top = positions[..., 2] > 0.199
    away = np.abs(positions[..., :2] - [0.03, 0]).max(axis=-1)
    velocity = waves.velocity
    under = velocity[top & (away < 0.15)]
    assert (under < 0).all()
    assert under.std() < 0.25 * abs(under.mean())
    assert np.abs(velocity[top & (away > 0.26)]).max() < 0.2 * abs(under.mean())


def test_cloth_loads_round_meshed_and_moving_targets_with_mujocos_forces() -> None:
    ball = '<geom name="target" size="0.2" mass="2"/>'
    mesh = '<geom name="target" type="{}" mesh="animal" pos="0 0 -0.25" mass="2"/>'
    flexed = draped(mesh.format("mesh"))
    make_collidable(flexed, "target", "flex")
    seen = f'<geom name="target" size="0.2" {SEEN}/><geom type="capsule" size="0.19 0.001"/>'
    for spec, tolerance in (
        (draped(ball), 1e-6),
        (draped(ball, '<joint type="slide" axis="0 0 1" stiffness="400"/>'), 1e-6),
        (draped(mesh.format("sdf")), 1e-6),
        (draped(seen), 1e-6),
        # its contacts push sideways too, and are summed as vectors
        (flexed, 0.03),
    ):
        run, told = play(spec, 0.25)
        assert run.pairs == {("target", "cloth")}
        assert told > 0.3
        assert run.given() == pytest.approx(told, rel=tolerance)


def test_risen_surface_pushes_a_cloth_up() -> None:
    heights = []
    for two_way in (False, True):
        spec = draped(BOX)
        spec.body("link").pos = [0, 0, 0.09]
        material = Material(speed=0.3, density=200.0)
        run = Run(
            spec, "target", material=material, resolution=24, two_way=two_way, conserve_volume=True
        ).until(0.06)
        run.ripples["target"].add_impulse([0.03, 0, 0.2], -5.0, 0.1)
        heights.append(run.until(0.11).data.flexvert_xpos[:, 2].max())
    assert heights[1] > heights[0] + 0.002


def test_warning_about_passive_contacts_without_forces() -> None:
    spec = draped(BOX, contact='passive="true"', integrator="discrete")
    with pytest.warns(
        RippleWarning, match="passive contacts of flex 'cloth', under which geom 'target' will"
    ):
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
