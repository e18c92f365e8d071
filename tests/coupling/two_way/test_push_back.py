"""Two-way coupling: a passing ripple kicks a resting ball, and what one gains the other loses."""

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


def test_forces_of_others_stay() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom name="block" type="box" size="0.5 0.5 0.2"/>
        <body name="ball" pos="0 0 0.2499"><freejoint/><geom size="0.05" mass="0.2"/></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"block": Material(density=20.0)}, resolution=16, backend="cpu", two_way=True)
    ripples["block"].velocity = np.ones((6, 16, 16))
    data.xfrc_applied[1, 0] = 0.25
    highest = 0.0
    for _ in range(100):
        mujoco.mj_step(model, data)
        ripples.step(data)
        highest = max(highest, data.qpos[2])
    assert highest > 0.2505  # it was pushed
    data.qpos[2] = 1.0  # out of reach, where nothing pushes any more
    mujoco.mj_step(model, data)
    ripples.step(data)
    np.testing.assert_allclose(data.xfrc_applied[1], [0.25, 0, 0, 0, 0, 0], atol=1e-12)
