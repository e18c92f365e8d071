"""Runs written as USD and read again by Blender, in a process of its own."""

import subprocess
from pathlib import Path

import mujoco
import numpy as np
import pytest

from ripple_sim import Exporter, Material, RippleError, Ripples
from ripple_sim.cycles.render import python_with_bpy

pytest.importorskip("pxr")

FRAMES, SURFACES = 7, ("egg", "jelly")
# the vertices in the world of every mesh at every frame
READ = """
import sys
import bpy
import numpy as np

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=sys.argv[1])
scene = bpy.context.scene
found = {"range": [scene.frame_start, scene.frame_end]}
for name in sys.argv[4:]:
    places = []
    for frame in range(int(sys.argv[3])):
        scene.frame_set(frame)
        thing = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = thing.to_mesh()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        world = np.array(thing.matrix_world)
        places.append(points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])
    found[name] = places
np.savez(sys.argv[2], **found)
"""


@pytest.mark.parametrize("chunk", [None, 3])
def test_blender_has_our_vertices_at_every_frame(soft_model: mujoco.MjModel, tmp_path: Path, chunk: int | None) -> None:
    """Also of a soft body, and of a run in chunks."""
    try:
        python = python_with_bpy()
    except RippleError as error:
        pytest.skip(str(error))
    data, waves = mujoco.MjData(soft_model), Material(speed=0.3, density=1500.0)
    ripples = Ripples(soft_model, dict.fromkeys(SURFACES, waves), resolution=8, backend="cpu")
    x, y, _ = np.moveaxis(ripples["egg"].atlas.normals, -1, 0)
    ripples["egg"].height = 0.02 * np.sin(5 * x) * np.cos(4 * y)
    seen: dict[str, list[np.ndarray]] = {name: [] for name in SURFACES}
    with Exporter(soft_model, ripples, tmp_path / "run.usdc", chunk=chunk) as exporter:
        for _ in range(FRAMES):
            ripples.mj_step(data, nstep=8)
            exporter.write(data)
            rotation, position = data.geom("egg").xmat.reshape(3, 3), data.geom("egg").xpos
            for name in SURFACES:
                mesh = exporter._source.mesh(name)
                points = mesh.shape(ripples[name].height, ripples[name].velocity, ripples.vertices(name, data)).points
                seen[name].append(points @ rotation.T + position if name == "egg" else points)
    arguments = [tmp_path / "run.usdc", tmp_path / "found.npz", FRAMES, *SURFACES]
    subprocess.run([python, "-c", READ, *map(str, arguments)], check=True, capture_output=True)
    with np.load(tmp_path / "found.npz") as found:
        assert found["range"].tolist() == [0, FRAMES - 1]
        for name in SURFACES:
            size = np.ptp(seen[name][0], axis=0).max()
            assert np.abs(found[name] - np.array(seen[name])).max() < 1e-6 * size
            assert np.abs(np.ptp(seen[name], axis=0)).max() > 1e-3 * size  # it moves
