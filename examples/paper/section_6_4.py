"""Section 6.4: what the paper leaves open, surfaces with handles.

python examples/paper/section_6_4.py [MESH]

On a torus, a rocker arm that is modelled here, and the project's pretzel, or another mesh instead
of the pretzel.
"""

import dataclasses
import sys
import tempfile
from pathlib import Path

import msgspec
import numpy as np
import trimesh
from page import Part
from scipy.spatial.transform import Rotation
from stills import strip

from ripple_sim import drop_scene
from ripple_sim.scene import Events, PokeEntry
from ripple_sim.scenes.shapes import (
    pebble,
    polygonise,
    rounded_cone,
    smooth_intersection,
    smooth_union,
)
from ripple_sim.solver import Atlas, build_atlas, load_mesh

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from arrival import arrival, mean_error, spread_sources

PRETZEL = Path(__file__).parents[2] / "scenes" / "meshes" / "pretzel.obj"
TIMES = [0.2, 0.4, 0.8, 1.2]
SIZE = (480, 400)
RESOLUTION = 96
SOURCES = 2


def torus(folder: Path) -> Path:
    """Write a torus that lies flat, z up."""
    path = folder / "torus.ply"
    trimesh.creation.torus(0.36, 0.14, major_sections=96, minor_sections=48).export(path)
    return path


def rocker_arm(folder: Path) -> Path:
    """Write the model of a rocker arm that lies flat, z up: a hub with a bore and a lever."""
    hub = pebble((0.0, 0.0, 0.0), 0.14, 0.1)

    def bore(points: np.ndarray) -> np.ndarray:
        return 0.11 - np.hypot(points[:, 0], points[:, 1])

    lever = rounded_cone((0.1, 0.0, 0.0), (0.52, 0.1, 0.02), 0.1, 0.06)
    other = rounded_cone((-0.1, 0.0, 0.0), (-0.36, 0.12, 0.0), 0.09, 0.075)
    solid = smooth_union(0.1, hub, lever, other, pebble((0.56, 0.11, 0.02), 0.04, 0.08))
    V, F = polygonise(
        smooth_intersection(0.05, solid, bore), ((-0.5, -0.3, -0.15), (0.75, 0.3, 0.15)), 0.016
    )
    path = folder / "rocker arm.ply"
    trimesh.Trimesh(V, F, process=False).export(path)
    return path


def stills(mesh: Path, file: Path) -> Path:
    """Waves after a poke from above, at the end of the mesh."""
    lies = mesh.stem in ("torus", "rocker arm")
    scene = drop_scene(mesh, bodies=0, up="z" if lies else None)
    material = msgspec.structs.replace(
        scene.targets[0].material, stiffness=300.0, damping=0.5, density=150.0
    )
    target = msgspec.structs.replace(scene.targets[0], material=material)
    camera = msgspec.structs.replace(
        scene.camera,
        azimuth=-70.0 if lies else 60.0,
        elevation=-45.0,
        orbit=0.0,
        distance=1.3 * scene.camera.distance,
    )
    geom = scene.model.geom("target")
    V = (
        scene.model.mesh_vert @ Rotation.from_quat(geom.quat, scalar_first=True).as_matrix().T
        + geom.pos
    )
    end = tuple(V[(V @ [0.5, 0.0, 0.3]).argmax()].tolist())
    events = Events(poke=(PokeEntry("target", 0.02, end, 0.25, 0.05),))
    scene = dataclasses.replace(scene, targets=(target,), camera=camera, events=events)
    return strip(scene, TIMES, file, SIZE, overlay=["height"], columns=4)


def row(name: str, atlas: Atlas) -> list[str]:
    error = mean_error([arrival(atlas, vertex) for vertex in spread_sources(atlas.mesh, SOURCES)])
    figures = [
        f"{100 * error[f'front_{key}']:.1f} %" for key in ("median", "q90", "under_3_percent")
    ]
    charts, n, _ = atlas.areas.shape
    return [name, str(int(atlas.mesh.genus.sum())), f"{charts} x {n} x {n}", *figures]


def make(folder: Path, mesh: Path = PRETZEL) -> Part:
    pictures = []
    rows = [
        ["surface", "handles", "texels", "arrival of the front: median error", "90 %", "under 3 %"]
    ]
    times = ", ".join(f"{t:g}" for t in TIMES)
    with tempfile.TemporaryDirectory() as own:
        for path in (torus(Path(own)), rocker_arm(Path(own)), mesh):
            file = stills(path, folder / f"section_6_4_{path.stem.replace(' ', '_')}.png")
            pictures.append(
                (
                    file,
                    f"{path.stem.capitalize()}: waves {times} s after the start, poked at 0.02 s.",
                )
            )
            rows.append(row(path.stem, build_atlas(load_mesh(path), RESOLUTION)))
    return Part(
        "Section 6.4: surfaces with handles",
        "A surface with handles cannot be mapped onto a sphere, nor onto the faces of a cube. "
        "The patch layout covers it with as many small square charts as it needs, and the same "
        "operator runs on their texels. Rings go round each handle and meet on its far side.",
        pictures,
        rows,
    )


if __name__ == "__main__":
    from run import alone

    alone(lambda folder: make(folder, *(Path(each) for each in sys.argv[1:2])))
