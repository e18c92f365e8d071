"""Gymnasium's Ant with a rippling torso, on which three balls fall.

    pip install 'ripple-sim[gymnasium]'
    python examples/gymnasium_ant.py

Makes out/gymnasium_ant.png: the ant 0.1, 0.2 and 0.3 s after the first hit. `RippleWrapper` is all
that it takes; the balls are there to have something to see.
"""

import tempfile
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
from gymnasium.envs import mujoco as environments
from PIL import Image

from ripple_sim import Material
from ripple_sim.gymnasium import RippleWrapper

CAMERA = {
    "lookat": np.array((0.0, 0.0, 0.6)),
    "distance": 1.05,
    "azimuth": 115.0,
    "elevation": -42.0,
}
BALLS = ((0.04, -0.13, 1.6), (-0.07, -0.03, 2.0), (0.12, -0.01, 2.5))


def ant_under_balls() -> str:
    """Gymnasium's model with balls above it, as MJCF."""
    spec = mujoco.MjSpec.from_file(str(Path(environments.__file__).parent / "assets" / "ant.xml"))
    spec.option.timestep = 0.004
    # with Ant's own, RK4, impulses are not exact
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.geom("torso_geom").material = ""
    spec.geom("torso_geom").rgba = (0.35, 0.6, 0.75, 1)
    for place in BALLS:
        ball = spec.worldbody.add_body(pos=place)
        ball.add_freejoint()
        ball.add_geom(
            size=(0.045, 0, 0),
            mass=0.15,
            conaffinity=1,
            rgba=(0.8, 0.3, 0.2, 1),
            solref=(0.01, 0.4),
        )
    return spec.to_xml()


def main() -> None:
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(ant_under_balls())
        file.flush()
        ant = gymnasium.make(
            "Ant-v5",
            xml_file=file.name,
            frame_skip=5,
            reset_noise_scale=0.0,
            render_mode="rgb_array",
            width=480,
            height=400,
            default_camera_config=CAMERA,
        )
    torso = Material(speed=0.6, damping=1.0, stiffness=100.0, viscosity=3e-4, density=450.0)
    env = RippleWrapper(ant, {"torso_geom": torso}, looks={"torso_geom": "jelly"}, resolution=96)

    env.reset(seed=0)
    frames = []
    since_hit = 0
    given = 0.0
    while len(frames) < 3:
        *_, info = env.step(np.zeros(8))
        given += sum(impulse.impulse for impulse in info["impulses"])
        since_hit += given > 0
        if since_hit in (6, 11, 16):
            frames.append(env.render())
    env.close()

    path = Path("out/gymnasium_ant.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    print(
        f"{given:.2f} N s, highest ripple {1000 * np.abs(info['heights']['torso_geom']).max():.1f} "
        f"mm; {path}"
    )


if __name__ == "__main__":
    main()
