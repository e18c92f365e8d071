"""Ripples in a MuJoCo loop of your own, and a picture of them.

    python examples/own_loop.py

Makes out/own_loop.png: a ball falls on an egg; the egg 0.06, 0.15 and 0.3 s after the hit.
"""

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from ripple_sim import Camera, Material, RippleRenderer, Ripples

MODEL = """<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" rgba="0.87 0.9 0.92 1"/>
    <geom name="egg" type="ellipsoid" size="0.42 0.3 0.3" pos="0 0 0.3" rgba="0.93 0.6 0.35 1"/>
    <body pos="0.08 -0.05 0.9"><freejoint/>
      <geom size="0.07" density="350" rgba="0.15 0.3 0.5 1" solref="0.005 0.3"/></body>
  </worldbody>
</mujoco>"""


def main() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    material = Material(speed=0.6, damping=1.5, stiffness=1500.0, viscosity=3e-4, density=300.0)
    ripples = Ripples(model, {"egg": material}, resolution=96)
    renderer = RippleRenderer(
        model, ripples, width=480, height=400, looks={"egg": "jelly"}, lighting="studio"
    )
    camera = Camera(lookat=(0.0, 0.0, 0.36), distance=1.5, azimuth=50.0, elevation=-48.0)

    frames = []
    hit = np.inf
    while len(frames) < 3:
        mujoco.mj_step(model, data)
        ripples.step(data)  # this step's contact forces become impulses, the waves advance
        if ripples.last_impulses:
            hit = min(hit, data.time)
        if data.time > hit + (0.06, 0.15, 0.3)[len(frames)]:
            frames.append(renderer.render(data, camera))

    path = Path("out/own_loop.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    print(f"highest ripple {1000 * ripples['egg'].height.max():.1f} mm; {path}")


if __name__ == "__main__":
    main()
