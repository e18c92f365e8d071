"""Two-way coupling with MuJoCo's options: solvers agree, bodies sleep, RK4 is refused."""

import itertools

import mujoco
import numpy as np
import pytest
from hits import Run

from ripple_sim import Material, Ripples
from ripple_sim.errors import SceneError

GRAVITY = 9.81
pytestmark = pytest.mark.filterwarnings("ignore:the waves on geom")

LIGHT = Material(speed=2.0, density=1.0)
CALM = Material(speed=2.0, density=20.0, stiffness=2000.0, damping=150.0)


def coupled(option: str, bodies: str, material: Material) -> Run:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" {option}</option><worldbody>
        <geom name="target" type="box" size="1 1 0.1" pos="0 0 -0.1"/>{bodies}</worldbody>
        </mujoco>"""
    )
    return Run(model, "target", material=material, resolution=12, two_way=True)


def falling(option: str) -> tuple[Run, float, float]:
    """A ball and a box fall on a light surface: greatest over initial energy, impulse [N s]."""
    bodies = """<body pos="0 0 0.07"><freejoint/><geom size="0.05" mass="0.05"/></body>
        <body pos="0.4 0 0.07"><freejoint/><geom type="box" size="0.05 0.05 0.05" mass="0.05"/>
        </body>"""
    run = coupled(option, bodies, LIGHT)
    start = most = run.ripples.energy(run.data).total
    for _ in range(60):
        run.step()
        most = max(most, run.ripples.energy(run.data).total)
    return run, most / start, run.given()


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
def test_every_solver_of_mujoco_finds_the_same_forces_and_makes_no_energy(cone: str) -> None:
    newton, _, impulse = falling(f'cone="{cone}">')
    others = [("CG", "sparse", 5), *itertools.product(["PGS"], ["dense", "sparse"], [0, 5])]
    for solver, jacobian, noslip in others:
        flag = "disable" if jacobian == "dense" else "enable"
        text = (
            f'solver="{solver}" jacobian="{jacobian}" cone="{cone}" noslip_iterations="{noslip}">'
        )
        run, most, given = falling(text + f'<flag island="{flag}"/>')
        assert most < 1.001, text
        assert given == pytest.approx(impulse, rel=0.01), text
        np.testing.assert_allclose(
            run.data.qpos[[2, 9]], newton.data.qpos[[2, 9]], atol=1e-4, err_msg=text
        )
    assert impulse > 0.05


def test_runge_kutta_is_refused_at_construction_and_at_a_later_step() -> None:
    run = coupled(
        'integrator="Euler">', '<body pos="0 0 0.05"><freejoint/><geom size="0.05"/></body>', LIGHT
    )
    run.step()
    run.model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(SceneError, match='"RK4"'):
        run.step()
    with pytest.raises(SceneError, match="two_way=False"):
        Ripples(run.model, {"target": LIGHT}, resolution=12, two_way=True)


STACK = """<body pos="0 0 0.05" {sleep}><freejoint/><geom type="box" size="0.1 0.1 0.05" mass="2"/>
</body>
    <body pos="0 0.02 0.149" {sleep}><freejoint/><geom type="box" size="0.05 0.05 0.05" mass="0.5"/>
    </body>"""
AT_REST = 0.8


def stack(flag: str, sleep: str = "") -> Run:
    """Two boxes on one another, laid on the surface and left for a while."""
    bodies = STACK.format(sleep=sleep)
    return coupled(f'sleep_tolerance="2e-3"><flag sleep="{flag}"/>', bodies, CALM).until(AT_REST)


@pytest.fixture(scope="module")
def places_without_sleep() -> np.ndarray:
    """Heights of both boxes at rest [m]."""
    return stack("disable").data.qpos[[2, 9]].copy()


@pytest.mark.parametrize("sleep", ["", 'sleep="init"'])
def test_a_sleeping_stack_keeps_its_dimple_and_its_pressure(
    sleep: str, places_without_sleep: np.ndarray
) -> None:
    run = stack("enable", sleep)
    assert (run.data.tree_asleep >= 0).all()
    assert places_without_sleep[0] < 0.047
    np.testing.assert_allclose(run.data.qpos[[2, 9]], places_without_sleep, atol=5e-4)
    place = run.data.qpos.copy()
    forces = [
        sum(hit.impulse for hit in hits) / 0.002 for hits in run.until(AT_REST + 0.05).hits[-25:]
    ]
    np.testing.assert_allclose(forces, 2.5 * GRAVITY, rtol=0.03)
    np.testing.assert_array_equal(run.data.qpos, place)


def test_a_wave_wakes_a_body_that_sleeps_on_the_surface(places_without_sleep: np.ndarray) -> None:
    run = stack("enable")
    run.ripples["target"].add_impulse([0.2, 0.0, 0.1], -10.0, 0.1)
    assert max(abs(run.until(AT_REST + 0.02 * i).data.qvel[2]) for i in range(1, 8)) > 0.01
