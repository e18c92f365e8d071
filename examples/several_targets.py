"""Several rippling bodies: they all move, and they make one another ripple.

    python examples/several_targets.py

Makes out/several_targets.png: a ball falls between two others.
"""

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from ripple_sim import Camera, Material, RippleRenderer, Ripples

MODEL = """<mujoco>
  <option timestep="0.002"/>
  <default><geom density="300" solref="0.008 0.4" friction="0.6 0.01 0.001" condim="6"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" rgba="0.9 0.88 0.84 1"/>
    <body pos="-0.3 0 0.25"><freejoint/><geom name="red" size="0.25" rgba="0.85 0.35 0.3 1"/></body>
    <body pos="0.3 0 0.25"><freejoint/><geom name="blue" size="0.25" rgba="0.25 0.5 0.62 1"/></body>
    <body pos="0.05 0.08 0.95"><freejoint/><geom name="yellow" size="0.2" rgba="0.93 0.75 0.35 1"/>
    </body>
  </worldbody>
</mujoco>"""
TIMES = (0.3, 0.42, 0.55)


def main() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    soft = Material(speed=0.6, damping=2.0, stiffness=1500.0, viscosity=3e-4, density=1600.0)
    ripples = Ripples(model, dict.fromkeys(("red", "blue", "yellow"), soft), resolution=64)
    looks = {"red": "rubber", "blue": "jelly", "yellow": "clay"}
    renderer = RippleRenderer(model, ripples, width=480, height=400, looks=looks, lighting="studio")
    camera = Camera(lookat=(0.0, 0.0, 0.36), distance=1.75, azimuth=80.0, elevation=-38.0)

    frames = []
    while len(frames) < len(TIMES):
        mujoco.mj_step(model, data)
        ripples.step(data)
        if data.time > TIMES[len(frames)]:
            frames.append(renderer.render(data, camera))

    path = Path("out/several_targets.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    for name in ripples:
        print(f"{name}: highest ripple {1000 * np.abs(ripples[name].height).max():.1f} mm")
    print(path)


if __name__ == "__main__":
    main()
