"""Feel hits on a bell: two environments whose observation has an accelerometer of the model.

pip install 'ripple-sim[gymnasium]'
python examples/gymnasium_felt_bell.py
"""

import functools
import tempfile
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
from gymnasium.envs.mujoco import MujocoEnv

from ripple_sim import Material, add_sensor
from ripple_sim.gymnasium import RippleWrapper

BELL = """<mujoco><worldbody><geom name="bell" type="sphere" size="0.1"/>
<site name="side" pos="0.1 0 0"/>
<body pos="0 0 0.2"><freejoint/><geom size="0.02" mass="0.01"/></body></worldbody></mujoco>"""
BRONZE = Material(speed=30.0, damping=10.0, density=2.0)


class Bell(MujocoEnv):
    metadata = {"render_modes": [], "render_fps": 50}  # noqa: RUF012

    def __init__(self, path: str) -> None:
        super().__init__(path, 10, gymnasium.spaces.Box(-np.inf, np.inf, (7,), float))

    def step(self, action):
        self.do_simulation(action, self.frame_skip)
        return self.data.qpos.copy(), 0.0, False, False, {}

    def reset_model(self):
        self.data.qpos[2] += self.np_random.uniform(0.0, 0.05)
        return self.data.qpos.copy()


def main() -> None:
    spec = mujoco.MjSpec.from_string(BELL)
    add_sensor(spec, "rim", geom="bell", site="side", rate=4000)
    gymnasium.register("Bell-v0", Bell)
    wrapper = functools.partial(
        RippleWrapper, materials={"bell": BRONZE}, sensors=["rim"], resolution=16
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bell.xml"
        path.write_text(spec.to_xml())
        environments = gymnasium.make_vec("Bell-v0", 2, wrappers=[wrapper], path=str(path))
    environments.reset(seed=0)
    for number in range(12):
        observation, *_ = environments.step(environments.action_space.sample())
        levels = np.abs(observation["rim"]).max(axis=(1, 2))
        print(f"step {number}: {levels[0]:8.3f} and {levels[1]:8.3f} m/s^2 at the most")
    environments.close()


if __name__ == "__main__":
    main()
