"""A ring of waves on a block, on its way to a ball."""

import mujoco
import numpy as np

from ripple_sim import Material, Ripples

GRAVITY = 9.81


def run(
    two_way: bool, speed: float = 2.0, target: str = "", mass: float = 0.2, gap: float = -1e-4, gravity: float = GRAVITY
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
