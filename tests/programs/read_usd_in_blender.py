"""Save the vertices in the world of some meshes of a USD file at every frame; needs Blender's bpy.

python read_usd_in_blender.py FILE RESULT FRAMES NAME ...; RESULT is an .npz with an array
[frames, vertices, 3] for each name, and the range of frames.
"""

import sys

import bpy
import numpy as np

path, result, frames, *names = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=path)
scene = bpy.context.scene
found = {"range": [scene.frame_start, scene.frame_end]}
for name in names:
    places = []
    for frame in range(int(frames)):
        scene.frame_set(frame)
        thing = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = thing.to_mesh()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        world = np.array(thing.matrix_world)
        places.append(points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])
    found[name] = places
np.savez(result, **found)
