"""The paper's table 1 with drawing: frames a second by resolution and polygon count.

    python examples/benchmarks/drawn_steps.py [--size 640x480] [--polygons 2700,21300] [--backends
    cpu,gl]

A frame is one substep of a running wave, its height map and the picture, read back. With the waves
on the processor heights go up to OpenGL; in OpenGL they stay there. The best of the frames of some
seconds counts.
"""

import argparse
import time

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ripple_sim import Camera
from ripple_sim.render import Renderer, Surface
from ripple_sim.render.surfaces import Charts
from ripple_sim.solver import Atlas, HeightMap, Material, Mesh, WaveSolver, build_atlas
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.layouts import atlas_from_sphere_map

RESOLUTIONS = (20, 28, 40, 56, 128, 256, 512)
POLYGONS = (2_700, 5_700, 10_700, 21_300)


def knobbly_body(polygons: int) -> Mesh:
    """A body with knobs and exactly this (even) number of triangles."""
    points = _spiral(polygons // 2 + 2)
    radius = 1 + 0.25 * np.sin(4 * points[:, :1]) * np.sin(3 * points[:, 1:2] + 1) * np.sin(
        4 * points[:, 2:] + 2
    )
    return Mesh.from_arrays(points * radius, ConvexHull(points).simplices, name="knobbly body")


def _spiral(count: int) -> NDArray[np.float64]:
    """Points spread evenly on the unit sphere (the golden spiral)."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    angle = k * np.pi * (3 - np.sqrt(5))
    return np.stack(
        [np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1
    )


def posed(mesh: Mesh) -> mujoco.MjModel:
    """A model of a mesh over a floor, under a lamp."""
    spec = mujoco.MjSpec()
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.add_mesh(name="target", uservert=mesh.V.ravel(), userface=mesh.F.ravel(), inertia=shell)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[-0.3, 0.4, -1], castshadow=True
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4, 4, 0.1], pos=[0, 0, mesh.V[:, 2].min()]
    )
    spec.worldbody.add_geom(
        name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="target", contype=0, conaffinity=0
    )
    return spec.compile()


def frames_per_second(
    model: mujoco.MjModel, atlas: Atlas, backend: str, size: tuple[int, int], seconds: float
) -> float:
    """Of a wave that runs over the target of a model."""
    data = mujoco.MjData(model)
    target = model.geom("target").id
    mujoco.mj_forward(model, data)
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), "rubber")
    camera = Camera((0.0, 0.0, 0.0), 4.5, 130.0, -22.0)
    height_map = HeightMap(atlas.texels)
    waves = WaveSolver(atlas, Material(), backend=backend)
    waves.add_impulse(atlas.mesh.V[0], impulse=0.01, radius=0.3)
    best = np.inf
    count = 0
    with Renderer(shared_context(), model, {target: surface}, size=size) as renderer:
        until = np.inf
        while count < 5 or time.perf_counter() < until:
            start = time.perf_counter()
            waves.step(waves.stable_timestep)
            renderer.render(data, {target: height_map(waves.snapshot())}, camera)
            if count == 2:  # shaders are compiled
                until = time.perf_counter() + seconds
                best = np.inf
            best = min(best, time.perf_counter() - start)
            count += 1
    return 1 / best


def main() -> None:
    parser = argparse.ArgumentParser(description="Frames a second, a wave step and a picture each.")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--polygons", default=",".join(map(str, POLYGONS)))
    parser.add_argument("--backends", default="cpu,gl")
    options = parser.parse_args()
    width, height = (int(n) for n in options.size.split("x"))
    print(
        f"{shared_context().renderer}, {options.size}\n| polygons | waves | "
        + " | ".join(f"N = {n}" for n in RESOLUTIONS)
    )
    for polygons in map(int, options.polygons.split(",")):
        body = build_atlas(knobbly_body(polygons), RESOLUTIONS[0], layout="cube")
        model = posed(body.mesh)
        atlases = [atlas_from_sphere_map(body.mesh, body.sphere, n) for n in RESOLUTIONS]
        for backend in options.backends.split(","):
            row = [
                frames_per_second(model, atlas, backend, (width, height), options.seconds)
                for atlas in atlases
            ]
            print(
                f"| {polygons:,} | {backend} | " + " | ".join(f"{each:.1f}" for each in row),
                flush=True,
            )


if __name__ == "__main__":
    main()
