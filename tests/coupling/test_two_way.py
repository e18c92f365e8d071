"""Two-way coupling: a risen surface pushes bodies, and momentum is conserved."""

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from hits import Run
from mujoco_models import posed

from ripple_sim import Material, Ripples
from ripple_sim.coupling import support_point

GRAVITY = 9.81
BALL_RADIUS = 0.05  # m
BLOCK_MASS = 5.0  # kg


class RingRun(NamedTuple):
    """A run of `ring` over its steps.

    Attributes
    ----------
    heights : [k]
        Of the ball's lowest point over the block at rest [m].
    times : [k]
        [s].
    bodies, surface : [k]
        Upward momentum of the bodies that can move, and of the waves [N s].
    speeds : [k]
        Greatest upward speed of the surface under the ball [m/s].
    """

    heights: np.ndarray
    times: np.ndarray
    bodies: np.ndarray
    surface: np.ndarray
    speeds: np.ndarray


def ring(
    two_way: bool,
    speed=2.0,
    target: str = "",
    mass: float = 0.2,
    gap: float = -1e-4,
    gravity: float = GRAVITY,
) -> RingRun:
    """Let a ring run to a ball that lies on a block, or above it by a gap [m]."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" gravity="0 0 {-gravity}"/><worldbody>
        <body name="block" pos="0 0 -0.2">{target}
        <geom name="block" type="box" size="0.5 0.5 0.2" mass="{BLOCK_MASS}"/></body>
        <body name="ball" pos="0 0 {BALL_RADIUS + gap}"><freejoint/>
        <geom name="ball" size="{BALL_RADIUS}" mass="{mass}"/></body>
        </worldbody></mujoco>"""
    )
    run = Run(
        model, "block", material=Material(speed=1.0, density=20.0), resolution=48, two_way=two_way
    )
    data = run.data
    waves = run.ripples["block"]
    # a ring on its way to the ball
    place = waves.atlas.positions
    away = np.hypot(place[..., 0], place[..., 1])
    on_top = place[..., 2] > 0.19
    under_ball = (away < 0.03) & on_top
    waves.velocity = speed * np.exp(-(((away - 0.12) / 0.03) ** 2)) * on_top
    rows = []
    while data.time < 0.3:
        run.step()
        upward = data.qvel[2::6] if target else data.qvel[2:3]
        masses = [BLOCK_MASS, mass] if target else [mass]
        rows.append(
            RingRun(
                heights=float(data.body("ball").xpos[2]) - BALL_RADIUS,
                times=data.time,
                bodies=float(np.dot(masses, upward)),
                surface=waves.momentum(),
                speeds=float(waves.velocity[under_ball].max()),
            )
        )
    return RingRun(*np.array(rows).T)


def test_a_passing_ripple_kicks_a_resting_ball_only_with_two_way_coupling() -> None:
    still = ring(two_way=False, speed=4.0, mass=0.05).heights
    kicked = ring(two_way=True, speed=4.0, mass=0.05).heights
    assert np.abs(still).max() < 1e-3
    assert kicked.max() > 0.01
    # not before the ring is there, 0.1 m away at 1 m/s less its width
    assert kicked[:25].max() < 1e-3


def test_ball_and_surface_exchange_momentum_and_keep_the_sum() -> None:
    run = ring(two_way=True)
    # only gravity acts from outside: no springs, no damping
    sums = run.surface + run.bodies + 0.2 * GRAVITY * run.times
    gained = np.abs(sums - sums[0])
    exchanged = abs(run.surface[0])
    # the rest filter holds back a part of long contacts, and there is none before 0.1 s
    assert gained[run.times < 0.1].max() < 1e-4 * exchanged
    assert run.bodies.max() > 0.02
    assert gained[run.times > 0.28].max() < 0.02 * exchanged


def test_free_target_recoils() -> None:
    """The rigid bodies alone keep their momentum: what the ball gains, the block under it loses."""
    run = ring(two_way=True, target="<freejoint/>")
    weight = (BLOCK_MASS + 0.2) * GRAVITY
    np.testing.assert_allclose(run.bodies, -weight * run.times, atol=2e-3)


def test_ball_is_never_thrown_faster_than_the_surface_moves() -> None:
    run = ring(two_way=True, speed=3.0, mass=0.001)
    fastest_ball = run.bodies.max() / 0.001
    fastest_surface = run.speeds.max()
    assert 0.5 * fastest_surface < fastest_ball < fastest_surface


FORCE = np.array([0.25, 0.0, 0.0, 0.0, 0.0, 0.0])  # a user's force and torque [N, N m]


def touching(geoms: str, gravity: float = -GRAVITY, **options: object) -> Run:
    """A body on a block that may push back."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 {gravity}"/><worldbody>
        <geom name="block" type="box" size="0.5 0.5 0.2"/>
        <body name="ball" pos="0 0 0.2499"><freejoint/>{geoms}</body></worldbody></mujoco>"""
    )
    return Run(model, "block", resolution=16, two_way=True, **options)


def pushed(force: Callable[[mujoco.MjData], None]) -> tuple[mujoco.MjData, Ripples]:
    """A ball on a block whose surface comes up, and the same forces of others at each step."""
    run = touching('<geom size="0.05" mass="0.2"/>', density=20.0, conserve_volume=True)
    highest = 0.0
    run.ripples["block"].velocity = np.ones((6, 16, 16))
    run.data.xfrc_applied[1] = FORCE
    for _ in range(100):
        force(run.data)
        run.step()
        highest = max(highest, run.data.qpos[2])
    assert highest > 0.2505  # it was pushed
    return run.data, run.ripples


def test_users_forces_stay_as_they_were() -> None:
    """A force of the user's is set once, assigned before each step, or removed and set again."""

    def assigned(data: mujoco.MjData) -> None:
        data.xfrc_applied[:] = 0.0
        data.xfrc_applied[1] = FORCE

    def added(data: mujoco.MjData) -> None:
        data.xfrc_applied[1] -= FORCE
        data.xfrc_applied[1] += FORCE

    once, _ = pushed(lambda data: None)
    for force in (assigned, added):
        data, _ = pushed(force)
        np.testing.assert_array_equal(data.qpos, once.qpos)
        np.testing.assert_array_equal(data.xfrc_applied[1], FORCE)


def test_a_reset_leaves_only_the_users_forces() -> None:
    data, ripples = pushed(lambda data: None)
    ripples.reset()
    np.testing.assert_array_equal(data.xfrc_applied, [[0.0] * 6, FORCE])
    data.time = 0.001  # earlier than the ripples have seen
    ripples.step(data)
    np.testing.assert_array_equal(data.xfrc_applied, [[0.0] * 6, FORCE])


def test_a_body_with_two_geoms_in_touch_is_pushed_once() -> None:
    """Two geoms on one patch do not make a body faster than the surface."""
    speeds = []
    for geoms in ('<geom size="0.05" mass="0.002"/>', 2 * '<geom size="0.05" mass="0.001"/>'):
        run = touching(geoms, gravity=0.0, density=20.0)
        run.ripples["block"].velocity = np.ones((6, 16, 16))
        speeds.append(run.until(0.02).data.qvel[2])
    assert 0.9 < min(speeds) <= max(speeds) <= 1.0
    assert speeds[0] == pytest.approx(speeds[1], rel=0.02)


def test_a_ripple_reaches_a_ball_above_it_only_up_to_its_height() -> None:
    """MuJoCo sees no contact; the displaced surface hits the ball, and loses what it gains."""
    run = ring(two_way=True, speed=4.0, mass=0.05, gap=0.004, gravity=0.0)
    assert run.heights[-1] > 0.05
    np.testing.assert_allclose((run.bodies + run.surface)[1:], run.surface[0], rtol=1e-4)
    missed = ring(two_way=True, speed=4.0, mass=0.05, gap=0.5, gravity=0.0).heights
    np.testing.assert_array_equal(missed, missed[0])


def test_a_moved_surface_gives_way_like_a_surface_built_there() -> None:
    """Twice as long and wide it has a quarter of the texels under a ball: it gives way more."""
    heights = []
    for steps_before in (3, 0):
        material = Material(1.0, density=20.0, stiffness=100.0)
        run = touching('<geom size="0.05" mass="2"/>', material=material, conserve_volume=True)
        run.ripples.mj_step(run.data, nstep=steps_before)
        run.ripples.reset()
        mujoco.mj_resetData(run.model, run.data)
        run.ripples["block"].move(run.ripples["block"].atlas.mesh.V * [2.0, 2.0, 1.0])
        heights.append(run.until(0.08).data.qpos[2])
    assert heights[0] == pytest.approx(heights[1], rel=1e-9)


GEOMS = {
    "sphere": 'type="sphere" size="0.3"',
    "ellipsoid": 'type="ellipsoid" size="0.3 0.2 0.1"',
    "capsule": 'type="capsule" size="0.1 0.3"',
    "cylinder": 'type="cylinder" size="0.2 0.3"',
    "box": 'type="box" size="0.3 0.2 0.1"',
    "mesh": 'type="mesh" mesh="tetrahedron"',
}


def geom_model(kind: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    return posed(
        f"""<mujoco><asset><mesh name="tetrahedron" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
        <worldbody><geom {GEOMS[kind]}/></worldbody></mujoco>"""
    )


@pytest.mark.parametrize("kind", GEOMS)
def test_no_ray_meets_the_geom_beyond_its_support_point(kind: str) -> None:
    model, data = geom_model(kind)
    rotation = data.geom_xmat[0].reshape(3, 3)
    origin = data.geom_xpos[0]
    rng = np.random.default_rng(3)
    geom = np.zeros(1, dtype=np.int32)

    def height(point: np.ndarray, direction: np.ndarray) -> float:
        """Height of the first hit of a ray against the direction; -inf without a hit."""
        start = point + 3.0 * direction
        away = mujoco.mj_ray(
            model, data, origin + rotation @ start, -rotation @ direction, None, 1, -1, geom
        )
        return float(start @ direction) - away if away >= 0 else -np.inf

    for direction in rng.standard_normal((20, 3)):
        direction /= np.linalg.norm(direction)
        farthest = support_point(model, 0, direction)
        aside = rng.uniform(-0.5, 0.5, (200, 3))
        assert (
            max(height(farthest + offset, direction) for offset in aside)
            <= farthest @ direction + 1e-3
        )
        # and it is a point of the geom: a ray just inside its rim meets it
        assert height(0.999 * farthest, direction) == pytest.approx(farthest @ direction, abs=5e-3)


def test_the_support_point_of_a_flat_face_is_its_middle() -> None:
    down = np.array([0.005, -0.004, -1.0])
    np.testing.assert_allclose(support_point(geom_model("box")[0], 0, down), [0, 0, -0.1])
    np.testing.assert_allclose(support_point(geom_model("cylinder")[0], 0, down), [0, 0, -0.3])
    np.testing.assert_allclose(
        support_point(geom_model("capsule")[0], 0, np.array([0.0, 1.0, 0.01])), [0, 0.1, 0.001]
    )
