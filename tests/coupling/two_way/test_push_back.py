"""Two-way coupling: a passing ripple kicks a resting ball, and what one gains the other loses."""

from collections.abc import Callable

import mujoco
import numpy as np
from ring_under_ball import GRAVITY, run

from ripple_sim import Material, Ripples


def test_passing_ripple_kicks_a_resting_ball_only_if_it_may() -> None:
    still, _, _ = run(two_way=False, speed=4.0, mass=0.05)
    kicked, _, _ = run(two_way=True, speed=4.0, mass=0.05)
    assert np.abs(still).max() < 1e-3
    assert kicked.max() > 0.01
    # not before the ring is there, 0.1 m away at 1 m/s less its width
    assert kicked[:25].max() < 1e-3


def test_ball_and_surface_exchange_momentum_and_keep_the_sum() -> None:
    _, total, _ = run(two_way=True)
    time, ball, surface, _ = total.T
    # gravity is all that acts from outside: no springs, no damping. Until 0.1 s no long contact has a deficit.
    early = time < 0.1
    start = surface[0] + ball[0] + 0.2 * GRAVITY * time[0]
    sums = surface + ball + 0.2 * GRAVITY * time
    assert np.abs(sums[early] - start).max() < 1e-4 * abs(surface[0])
    assert ball.max() > 0.02
    late = time > 0.28
    assert np.abs(sums[late] - start).max() < 0.02 * abs(surface[0])


def test_free_target_recoils() -> None:
    """The rigid bodies alone keep their momentum: what the ball gains, the block under it loses."""
    _, total, _ = run(two_way=True, target="<freejoint/>")
    time, bodies, _, _ = total.T
    np.testing.assert_allclose(bodies, -5.2 * GRAVITY * time, atol=2e-3)


def test_ball_is_never_thrown_faster_than_the_surface_moves() -> None:
    _, total, _ = run(two_way=True, speed=3.0, mass=0.001)
    fastest, surface = total[:, 1].max() / 0.001, total[:, 3].max()
    assert 0.5 * surface < fastest < surface


def pushed(force: Callable[[mujoco.MjData], None]) -> tuple[mujoco.MjData, Ripples]:
    """A ball on a block whose surface comes up, and the same forces of others at each step."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom name="block" type="box" size="0.5 0.5 0.2"/>
        <body name="ball" pos="0 0 0.2499"><freejoint/><geom size="0.05" mass="0.2"/></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"block": Material(density=20.0)}, resolution=16, backend="cpu", two_way=True)
    ripples["block"].velocity = np.ones((6, 16, 16))
    highest = 0.0
    data.xfrc_applied[1] = FORCE
    for _ in range(100):
        force(data)
        mujoco.mj_step(model, data)
        ripples.step(data)
        highest = max(highest, data.qpos[2])
    assert highest > 0.2505  # it was pushed
    return data, ripples


FORCE = np.array([0.25, 0.0, 0.0, 0.0, 0.0, 0.0])


def test_forces_of_others_stay_theirs() -> None:
    """Set once, or assigned before each step, which wiped out the push, or taken back and added anew."""

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


def test_nothing_is_left_after_a_reset() -> None:
    data, ripples = pushed(lambda data: None)
    ripples.reset()
    np.testing.assert_array_equal(data.xfrc_applied, [[0.0] * 6, FORCE])
    data.time = 0.001  # earlier than the ripples have seen
    ripples.step(data)
    np.testing.assert_array_equal(data.xfrc_applied, [[0.0] * 6, FORCE])


def test_a_body_that_touches_twice_is_pushed_once() -> None:
    """Two of its geoms on the same patch together do not make it faster than the surface."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><geom name="block" type="box" size="0.5 0.5 0.2"/>
        <body name="ball" pos="0 0 0.2499"><freejoint/><geom size="0.05" mass="0.001"/><geom size="0.05" mass="0.001"/>
        </body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(
        model, {"block": Material(density=20.0)}, resolution=16, backend="cpu", two_way=True, conserve_volume=False
    )
    ripples["block"].velocity = np.ones((6, 16, 16))
    mujoco.mj_step(model, data)
    ripples.step(data)
    assert 0.9 < data.qvel[2] <= 1.0
