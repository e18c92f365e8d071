"""A speed that is painted on the mesh: slow and fast stripes bend the rings.

    python examples/painted_speed.py

Makes out/painted_speed.png. Here the paint is computed at the mesh's vertices; `texture_map` takes
a picture instead.
"""

from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from ripple_sim import Camera, Material, RippleRenderer, Ripples
from ripple_sim.solver import vertex_map

MODEL = """<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" rgba="0.86 0.87 0.9 1"/>
    <geom name="egg" type="ellipsoid" size="0.45 0.32 0.3" pos="0 0 0.3" rgba="0.5 0.72 0.62 1"/>
  </worldbody>
</mujoco>"""
# m/s
SLOW = 0.25
FAST = 0.7


def main() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ripples = Ripples(
        model,
        {"egg": Material(damping=0.5, stiffness=400.0, viscosity=2e-4, density=100.0)},
        resolution=128,
    )
    atlas = ripples["egg"].atlas
    stripes = 0.5 + 0.5 * np.tanh(8 * np.sin(18 * atlas.mesh.V[:, 0]))
    speed = vertex_map(atlas, SLOW + (FAST - SLOW) * stripes)  # one value a texel
    ripples.change_material("egg", speed=speed)

    ripples.poke("egg", (0.02, -0.05, 0.6), 0.6, radius=0.05)  # in the frame of its body, the world
    renderer = RippleRenderer(
        model, ripples, width=480, height=400, looks={"egg": "clay"}, lighting="studio"
    )
    camera = Camera(lookat=(0.0, 0.0, 0.3), distance=1.7, azimuth=90.0, elevation=-50.0)
    frames = []
    for _ in range(3):
        ripples["egg"].step(0.2)
        frames.append(renderer.render(data, camera))

    path = Path("out/painted_speed.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    print(f"wave speed {speed.min():.2f} to {speed.max():.2f} m/s; {path}")


if __name__ == "__main__":
    main()
