"""Two-way coupling: a passing ripple kicks a resting ball, and what one gains the other loses."""

import mujoco
import numpy as np

from ripple_sim import Material, Ripples

GRAVITY = 9.81


def run(
    two_way: bool,
    speed: float = 2.0,
    target: str = "",
    mass: float = 0.2,
    gap: float = -1e-4,
    gravity: float = GRAVITY,
):
    """Let a ring run to a ball on a block, or above it: heights, and over time both momenta and the speed under it."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" gravity="0 0 {-gravity}"/><worldbody>
        <body name="block" pos="0 0 -0.2">{target}
        <geom name="block" type="box" size="0.5 0.5 0.2" mass="5"/></body>
        <body name="ball" pos="0 0 {0.05 + gap}"><freejoint/><geom name="ball" size="0.05" mass="{mass}"/></body>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    material = Material(speed=1.0, density=20.0)
    ripples = Ripples(model, {"block": material}, resolution=48, backend="cpu", conserve_volume=False, two_way=two_way)
    waves = ripples["block"]
    # a ring on its way to the ball
    place = waves.atlas.positions
    away = np.hypot(place[..., 0], place[..., 1])
    waves.velocity = speed * np.exp(-(((away - 0.12) / 0.03) ** 2)) * (place[..., 2] > 0.19)
    heights, total = [], []
    while data.time < 0.3:
        mujoco.mj_step(model, data)
        ripples.step(data)
        joints = data.qvel[2::6] if target else data.qvel[2:3]
        masses = [5.0, mass] if target else [mass]
        heights.append(float(data.body("ball").xpos[2]) - 0.05)
        under = float(waves.velocity[(away < 0.03) & (place[..., 2] > 0.19)].max())
        total.append((data.time, float(np.dot(masses, joints)), waves.momentum(), under))
    return np.array(heights), np.array(total), waves


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
    # gravity is all that acts from outside: no springs, no damping. Until 0.1 s nothing is owed from a long contact.
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


def test_ripple_reaches_a_ball_that_hovers_as_high_as_the_wave_only() -> None:
    """MuJoCo sees no contact; the ball is met by the displaced surface, and what it gains the surface loses."""
    heights, total, _ = run(two_way=True, speed=4.0, mass=0.05, gap=0.004, gravity=0.0)
    assert heights[-1] > 0.05
    _, ball, surface, _ = total.T
    np.testing.assert_allclose((ball + surface)[1:], surface[0], rtol=1e-4)
    missed, _, _ = run(two_way=True, speed=4.0, mass=0.05, gap=0.5, gravity=0.0)
    np.testing.assert_array_equal(missed, missed[0])


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
