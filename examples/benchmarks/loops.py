"""How much of a bouncing ball's momentum the waves receive, loop by loop.

    python examples/benchmarks/loops.py

A ball of 0.3 kg falls on a block for 0.2 s. The share is the sum of the impulses that the ripples
report over the momentum that the ball has gained against gravity. Loops of packages that are not
installed are left out.
"""

import importlib.util
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np

from ripple_sim import Material, Ripples, RippleWarning

STEPS = 100
AT_ONCE = 5
MASS = 0.3
GRAVITY = 9.81
MODEL = f"""<mujoco><option timestep="0.002"/><worldbody>
  <geom name="block" type="box" size="0.5 0.5 0.2" pos="0 0 -0.2" solref="0.01 0.3"/>
  <body name="ball" pos="0.03 0.02 0.06"><freejoint/>
  <geom size="0.05" mass="{MASS}" solref="0.01 0.3"/></body>
</worldbody></mujoco>"""
MATERIALS = {"block": Material(speed=1.0, density=100.0)}


def given(ripples: Ripples) -> float:
    return sum(impulse.impulse for impulse in ripples.last_impulses)


def own_loops() -> Iterator[tuple[str, float, mujoco.MjData]]:
    def several_at_once(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_step(model, data, nstep=AT_ONCE)
        ripples.step(data)

    def own_step(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        ripples.mj_step(data, nstep=AT_ONCE)

    def followed(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        with ripples.following(data):
            mujoco.mj_step(model, data, nstep=AT_ONCE)

    def each(finish: Callable[[mujoco.MjModel, mujoco.MjData], None]) -> Callable[..., None]:
        def loop(ripples: Ripples, model: mujoco.MjModel, data: mujoco.MjData) -> None:
            finish(model, data)
            ripples.step(data)

        return loop

    def halves(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_step1(model, data)
        mujoco.mj_step2(model, data)

    def swapped(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_step2(model, data)
        mujoco.mj_step1(model, data)

    loops = {
        "mj_step; step": each(mujoco.mj_step),
        "mj_step1; mj_step2; step": each(halves),
        "mj_step2; mj_step1; step": each(swapped),
        f"mj_step(nstep={AT_ONCE}); step": several_at_once,
        f"ripples.mj_step(nstep={AT_ONCE})": own_step,
        f"following: mj_step(nstep={AT_ONCE})": followed,
    }
    for name, loop in loops.items():
        model = mujoco.MjModel.from_xml_string(MODEL)
        ripples = Ripples(model, MATERIALS, resolution=16, backend="cpu")
        data = mujoco.MjData(model)
        total = 0.0
        while data.time < 0.002 * STEPS - 1e-6:
            loop(ripples, model, data)
            total += given(ripples)
        yield name, total, data


def gymnasium_loop() -> tuple[str, float, mujoco.MjData]:
    import gymnasium
    from gymnasium.envs.mujoco import MujocoEnv

    from ripple_sim.gymnasium import RippleWrapper

    class Ball(MujocoEnv):
        metadata = {"render_fps": 100}  # noqa: RUF012

        def step(self, action):
            self.do_simulation(action, self.frame_skip)
            return self.data.qpos.copy(), 0.0, False, False, {}

        def reset_model(self):
            return self.data.qpos.copy()

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ball.xml"
        file.write_text(MODEL)
        ball = Ball(str(file), AT_ONCE, gymnasium.spaces.Box(-np.inf, np.inf, (7,)))
    env = RippleWrapper(ball, MATERIALS, resolution=16, backend="cpu")
    env.reset()
    total = 0.0
    for _ in range(STEPS // AT_ONCE):
        *_, info = env.step(np.zeros(0))
        total += sum(impulse.impulse for impulse in info["impulses"])
    return f"RippleWrapper, frame_skip={AT_ONCE}", total, ball.data


def dm_control_loop() -> tuple[str, float, mujoco.MjData]:
    from dm_control.mujoco import Physics

    from ripple_sim.dm_control import couple

    physics = Physics.from_xml_string(MODEL)
    ripples = couple(physics, MATERIALS, resolution=16, backend="cpu")
    total = 0.0
    for _ in range(STEPS // AT_ONCE):
        physics.step(AT_ONCE)
        total += given(ripples)
    return f"couple, physics.step({AT_ONCE})", total, physics.data.ptr


def main() -> None:
    # read by dm_control and gymnasium, which have nothing to draw
    os.environ.setdefault("MUJOCO_GL", "disable")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RippleWarning)
        rows = list(own_loops())
        for package, loop in (("gymnasium", gymnasium_loop), ("dm_control", dm_control_loop)):
            if importlib.util.find_spec(package) is not None:
                rows.append(loop())
    print("| loop | impulses over gain of momentum |\n| --- | --- |")
    for name, total, data in rows:
        gained = MASS * (data.qvel[2] + GRAVITY * data.time)
        print(f"| `{name}` | {total / gained:.4f} |")


if __name__ == "__main__":
    main()
