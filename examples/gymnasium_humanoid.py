"""Gymnasium's Humanoid with a rippling torso, at which three balls are thrown.

    pip install 'ripple-sim[gymnasium]'
    python examples/gymnasium_humanoid.py

Makes out/gymnasium_humanoid.png: the humanoid 0.04, 0.1 and 0.18 s after the first hit.
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
    "lookat": np.array((0.0, 0.0, 1.27)),
    "distance": 0.7,
    "azimuth": 165.0,
    "elevation": -3.0,
}
TORSO = ("torso1", "uwaist", "lwaist")
BALLS = ((0.75, 0.05, 1.27), (1.0, -0.05, 1.30), (1.25, 0.01, 1.31))
SPEED = (-4.0, 0.0, 1.0)  # m/s


def humanoid_and_balls() -> str:
    """Gymnasium's model with balls before it, as MJCF."""
    spec = mujoco.MjSpec.from_file(
        str(Path(environments.__file__).parent / "assets" / "humanoid.xml")
    )
    spec.option.timestep = 0.001
    # with its own, RK4, impulses are not exact
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.default.geom.material = ""
    for name in TORSO:
        spec.geom(name).material = ""
        spec.geom(name).rgba = (0.25, 0.55, 0.75, 1)
    for place in BALLS:
        ball = spec.worldbody.add_body(pos=place)
        ball.add_freejoint()
        ball.add_geom(size=(0.028, 0, 0), mass=0.08, rgba=(0.8, 0.3, 0.2, 1), solref=(0.003, 0.6))
    return spec.to_xml()


def main() -> None:
    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(humanoid_and_balls())
        file.flush()
        humanoid = gymnasium.make(
            "Humanoid-v5",
            xml_file=file.name,
            frame_skip=10,
            reset_noise_scale=0.0,
            render_mode="rgb_array",
            width=480,
            height=400,
            default_camera_config=CAMERA,
        )
    material = Material(speed=0.35, damping=1.0, stiffness=100.0, viscosity=1e-4, density=700.0)
    env = RippleWrapper(humanoid, dict.fromkeys(TORSO, material), resolution=64)

    for name in TORSO:
        env.ripples.allow_any_height(name)  # the dents under the balls are meant to be deep

    env.reset(seed=0)
    world = humanoid.unwrapped
    velocity = world.init_qvel.copy()
    velocity[-6 * len(BALLS) :].reshape(-1, 6)[:, :3] = SPEED
    world.set_state(world.init_qpos, velocity)
    frames = []
    since_hit = 0
    given = 0.0
    while len(frames) < 3:
        *_, info = env.step(np.zeros(17))
        given += sum(impulse.impulse for impulse in info["impulses"])
        since_hit += given > 0
        if since_hit in (5, 11, 19):
            frames.append(env.render())
    env.close()

    path = Path("out/gymnasium_humanoid.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    for name, height in info["heights"].items():
        print(f"{name}: highest ripple {1000 * np.abs(height).max():.1f} mm")
    print(f"{given:.2f} N s; {path}")


if __name__ == "__main__":
    main()
