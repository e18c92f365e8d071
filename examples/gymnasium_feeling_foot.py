"""Two of Gymnasium's ants feel the floor: the observation has an accelerometer on a foot.

pip install 'ripple-sim[gymnasium]'
python examples/gymnasium_feeling_foot.py
"""

import functools
import tempfile
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
from gymnasium.envs import mujoco as environments_of_mujoco

from ripple_sim import Material, add_sensor
from ripple_sim.gymnasium import RippleWrapper

ANT = Path(environments_of_mujoco.__file__).parent / "assets" / "ant.xml"
RUBBER = Material(speed=8.0, damping=30.0, density=500.0)


def main() -> None:
    spec = mujoco.MjSpec.from_file(str(ANT))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # impulses are exact with it
    foot = spec.geom("left_ankle_geom")
    foot.parent.add_site(name="left_toe", pos=foot.fromto[3:])
    add_sensor(spec, "toe", geom="left_ankle_geom", site="left_toe", rate=1000)
    wrapper = functools.partial(
        RippleWrapper, materials={"left_ankle_geom": RUBBER}, sensors=["toe"], resolution=16
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ant.xml"
        path.write_text(spec.to_xml())
        ants = gymnasium.make_vec("Ant-v5", 2, wrappers=[wrapper], xml_file=str(path))
    ants.reset(seed=0)
    ants.action_space.seed(0)
    for number in range(20):
        observation, *_ = ants.step(ants.action_space.sample())
        levels = np.abs(observation["toe"]).max(axis=(1, 2))
        print(f"step {number}: {levels[0]:.1f} and {levels[1]:.1f} m/s^2 at most")
    ants.close()


if __name__ == "__main__":
    main()
