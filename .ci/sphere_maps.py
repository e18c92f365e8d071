"""Compute the sphere maps of the shipped scenes again, and remove those no scene needs."""

import numpy as np

from ripple_sim.coupling import TARGET_TYPES, find_target, is_geom
from ripple_sim.coupling.target_mesh import target_mesh
from ripple_sim.scene import load_scene, shipped_scenes
from ripple_sim.scenes.sphere_maps import FOLDER, sphere_map_path
from ripple_sim.solver.layouts.sphere_map import progressive_sphere_map

needed = set()
for name in shipped_scenes():
    scene = load_scene(name)
    for target in scene.targets:
        geom = find_target(scene.model, target.geom)
        if (
            not is_geom(geom, scene.model)
            or TARGET_TYPES[int(scene.model.geom_type[geom])] == "sphere"
        ):
            continue
        mesh = target_mesh(scene.model, geom)
        if not mesh.closed or mesh.genus.tolist() != [0]:
            continue  # its atlas has the patch layout
        path = sphere_map_path(mesh)
        np.save(path, progressive_sphere_map(mesh.V, mesh.F))
        needed.add(path)
        print(f"{path.name}  {path.stat().st_size / 1000:.0f} kB  {name}, {target.geom}")
for path in set(FOLDER.glob("*.npy")) - needed:
    path.unlink()
