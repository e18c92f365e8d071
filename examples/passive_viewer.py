"""Ripples in MuJoCo's own passive viewer: a skin over the target follows its waves.

    python examples/passive_viewer.py              # needs a display; on macOS: mjpython
    python examples/passive_viewer.py --picture

The second makes out/passive_viewer.png with MuJoCo's own renderer: before the hit, and 0.1 and 0.3 s after it.
"""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

if "--picture" in sys.argv:
    os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import mujoco.viewer
import numpy as np
import trimesh
from PIL import Image

from ripple_sim import Material, Ripples

HALF = np.array([0.42, 0.3, 0.3])  # m
MODEL = """<mujoco>
  <visual><headlight ambient="0.3 0.3 0.3"/></visual>
  <worldbody>
    <light pos="1 -1 3" dir="-1 1 -3"/>
    <geom name="floor" type="plane" size="2 2 0.1" rgba="0.8 0.84 0.87 1"/>
    <body name="nest" pos="0 0 0.3">
      <geom name="egg" type="ellipsoid" size="0.42 0.3 0.3" rgba="0 0 0 0"/>
    </body>
    <body pos="0.08 -0.05 0.9"><freejoint/>
      <geom size="0.07" density="350" rgba="0.15 0.3 0.5 1" solref="0.005 0.3"/></body>
  </worldbody>
</mujoco>"""


def skinned() -> tuple[mujoco.MjModel, trimesh.Trimesh]:
    """The model with a fine skin over the egg, which is invisible itself; and the skin's mesh in the egg's frame."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    mesh = trimesh.Trimesh(ball.vertices * HALF, ball.faces, process=False)
    count = len(mesh.vertices)
    spec = mujoco.MjSpec.from_string(MODEL)
    skin = spec.add_skin(
        name="egg skin", rgba=[0.93, 0.6, 0.35, 1], vert=mesh.vertices.ravel(), face=mesh.faces.ravel()
    )
    skin.bodyname, skin.bindpos, skin.bindquat = ["nest"], [0, 0, 0], [1, 0, 0, 0]
    skin.vertid, skin.vertweight = [np.arange(count).tolist()], [np.ones(count).tolist()]
    return spec.compile(), mesh


def follower(model: mujoco.MjModel, mesh: trimesh.Trimesh, ripples: Ripples) -> Callable[[], None]:
    """Moves the skin's vertices along their normals by the heights there."""
    waves = ripples["egg"]
    sampling = waves.atlas.sampling_matrix(mesh.vertices)  # texels to vertices

    def follow() -> None:
        height = sampling @ waves.height.ravel()
        model.skin_vert[:] = mesh.vertices + height[:, None] * mesh.vertex_normals

    return follow


def main() -> None:
    model, mesh = skinned()
    data = mujoco.MjData(model)
    material = Material(speed=0.6, damping=1.5, stiffness=1500.0, viscosity=3e-4, density=300.0)
    ripples = Ripples(model, {"egg": material}, resolution=64)
    follow = follower(model, mesh, ripples)
    if "--picture" in sys.argv:
        picture(model, data, ripples, follow)
        return
    with mujoco.viewer.launch_passive(model, data) as viewer:
        while viewer.is_running():
            start = time.perf_counter()
            ripples.mj_step(data, nstep=8)
            follow()
            viewer.sync()
            time.sleep(max(0.0, 8 * model.opt.timestep - (time.perf_counter() - start)))


def picture(model: mujoco.MjModel, data: mujoco.MjData, ripples: Ripples, follow: Callable[[], None]) -> None:
    frames = []
    with mujoco.Renderer(model, height=320, width=400) as renderer:
        camera = mujoco.MjvCamera()
        camera.lookat, camera.distance, camera.azimuth, camera.elevation = (0, 0, 0.3), 1.6, 50, -40
        for moment in (0.05, 0.4, 0.6):
            while data.time < moment:
                ripples.mj_step(data)
            follow()
            renderer.update_scene(data, camera)
            frames.append(renderer.render().copy())
    path = Path("out/passive_viewer.png")
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.concatenate(frames, axis=1)).save(path)
    print(f"highest ripple {1000 * ripples['egg'].height.max():.1f} mm; {path}")


if __name__ == "__main__":
    main()
