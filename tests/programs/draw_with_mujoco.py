"""Draw models with MuJoCo's own renderer, under white ambient light alone.

python draw_with_mujoco.py RESULT MODEL ...; RESULT is an .npy file [models, 240, 320, 3].
"""

import sys

import mujoco
import numpy as np

result, *paths = sys.argv[1:]
frames = []
for path in paths:
    model = mujoco.MjModel.from_binary_path(path)
    model.vis.headlight.ambient[:] = 1
    model.vis.headlight.diffuse[:] = 0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.distance = 4.2
    camera.azimuth = 70
    camera.elevation = -50
    with mujoco.Renderer(model, 240, 320) as renderer:
        renderer.update_scene(data, camera)
        frames.append(renderer.render())
np.save(result, frames)
