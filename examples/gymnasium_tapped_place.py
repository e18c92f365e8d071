"""Find which of four places on a board was tapped, from four accelerometers.

    pip install 'ripple-sim[gymnasium]'
    python examples/gymnasium_tapped_place.py

A ball drops on one of four places, 2 cm off at most. The observation has the accelerations of each
control step; what is learned from 160 drops is a linear map from the levels at the corners and who
heard first to the place.
"""

import tempfile
from pathlib import Path

import gymnasium
import numpy as np
from gymnasium.envs.mujoco import MujocoEnv

from ripple_sim import Material
from ripple_sim.gymnasium import RippleWrapper

DROPS = 240
PLACES = np.array([(-0.12, -0.08), (0.12, -0.08), (-0.12, 0.08), (0.12, 0.08)])  # m
CORNERS = [(x, y, 0.01) for x in (-0.19, 0.19) for y in (-0.14, 0.14)]
SENSORS = {"corners": {"geom": "board", "at": CORNERS, "rate": 4000}}
BOARD = """<mujoco><option timestep="0.001"/><worldbody>
<geom name="board" type="box" size="0.2 0.15 0.01" solref="0.002 0.3"/>
<body pos="0 0 0.05"><freejoint/><geom size="0.012" mass="0.01" solref="0.002 0.3"/></body>
</worldbody></mujoco>"""


class Taps(MujocoEnv):
    metadata = {"render_modes": [], "render_fps": 20}  # noqa: RUF012

    def __init__(self, path: Path) -> None:
        super().__init__(str(path), 50, gymnasium.spaces.Box(-np.inf, np.inf, (7,)))

    def step(self, action):
        self.do_simulation(action, self.frame_skip)
        return self.data.qpos.copy(), 0.0, False, False, {}

    def reset_model(self):
        self.place = int(self.np_random.integers(4))
        self.data.qpos[:2] = PLACES[self.place] + self.np_random.uniform(-0.02, 0.02, 2)
        self.data.qpos[2] = self.np_random.uniform(0.03, 0.06)
        return self.data.qpos.copy()


def drop(env: RippleWrapper, seed: int) -> tuple[np.ndarray, int]:
    """Features of a drop, and where it was."""
    env.reset(seed=seed)
    heard = np.concatenate([env.step(np.zeros(0))[0]["corners"] for _ in range(4)])
    levels = np.log(np.abs(heard).max(axis=0) + 1e-9)
    first = (np.abs(heard) > 0.1 * np.abs(heard).max()).argmax(axis=0)
    return np.concatenate(
        [levels - levels.mean(), first - first.mean(), [1.0]]
    ), env.unwrapped.place


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "board.xml"
        path.write_text(BOARD)
        material = Material(speed=20.0, damping=20.0, viscosity=0.02, density=50.0)
        env = RippleWrapper(Taps(path), {"board": material}, sensors=SENSORS, resolution=16)
        features, places = map(
            np.array, zip(*(drop(env, seed) for seed in range(DROPS)), strict=True)
        )
    taught = 2 * DROPS // 3
    learned = np.linalg.lstsq(features[:taught], np.eye(4)[places[:taught]], rcond=None)[0]
    right = (features[taught:] @ learned).argmax(axis=1) == places[taught:]
    print(
        f"{right.mean():.0%} of {len(right)} taps are found on the right place; by chance it would "
        f"be 25%"
    )


if __name__ == "__main__":
    main()
