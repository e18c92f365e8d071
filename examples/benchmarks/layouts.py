"""Cost of a wave step and of a frame: the patch layout against the cube layout.

    python examples/benchmarks/layouts.py [MESH] [--resolution 128] [--size 1280x720] [--frames 15]

Seconds a substep and texel, patches over cube, so that a few texels more or less do not count; the
two take turns, on the CPU and, where there is OpenGL, in its compute shaders. Then seconds a frame
of the mesh with a running wave.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from ripple_sim import Camera
from ripple_sim.bench import backend_advance, race
from ripple_sim.render import Renderer, Surface
from ripple_sim.render.surfaces import Charts
from ripple_sim.solver import (
    Atlas,
    GLError,
    HeightMap,
    Material,
    Mesh,
    build_atlas,
    build_operator,
    load_mesh,
)
from ripple_sim.solver.gl import shared_context

MESH = Path(__file__).parents[2] / "scenes" / "meshes" / "duck.obj"


def frames(mesh: Mesh, atlas: Atlas, size: tuple[int, int]) -> Callable[[int], object]:
    """A function that draws frame i of a wave on a mesh over a floor, from the height on."""
    spec = mujoco.MjSpec()
    middle = (mesh.V.max(axis=0) + mesh.V.min(axis=0)) / 2
    extent = np.ptp(mesh.V)
    spec.add_mesh(
        name="target",
        uservert=mesh.V.ravel(),
        userface=mesh.F.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[-0.3, 0.4, -1], castshadow=True
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4, 4, 0.1], pos=[0, 0, mesh.V[:, 2].min()]
    )
    spec.worldbody.add_geom(
        name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="target", contype=0, conaffinity=0
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    target = model.geom("target").id
    mujoco.mj_forward(model, data)
    surface = Surface(mesh.V, mesh.F, Charts.of(atlas), "rubber")
    renderer = Renderer(shared_context(), model, {target: surface}, size=size, samples=4)
    camera = Camera(tuple(middle), 2 * extent, 130.0, -22.0)
    height_map = HeightMap(atlas.texels)
    waves = [
        0.01 * extent * np.sin(50 / extent * atlas.positions[..., 2] + phase) for phase in range(4)
    ]
    return lambda i: renderer.render(
        data, {target: height_map(waves[i % 4].astype(np.float32))}, camera
    )


def frame_ratio(draw: dict[str, Callable[[int], object]], count: int) -> float:
    """Median over the rounds of seconds of a frame, patches over cube."""
    seconds: dict[str, list[float]] = {name: [] for name in draw}
    for i in range(count + 2):
        for name, each in draw.items():
            start = time.perf_counter()
            each(i)
            seconds[name].append(time.perf_counter() - start)
    return float(np.median(np.divide(seconds["patches"], seconds["cube"])[2:]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Cost of a wave step and of a frame, patch layout over cube layout."
    )
    parser.add_argument("mesh", type=Path, nargs="?", default=MESH)
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--frames", type=int, default=15)
    options = parser.parse_args()
    width, height = (int(n) for n in options.size.split("x"))
    mesh = load_mesh(options.mesh)
    atlases = {
        name: build_atlas(mesh, options.resolution, layout=name) for name in ("cube", "patches")
    }
    operators = {name: build_operator(atlas, Material(), "fem") for name, atlas in atlases.items()}
    for name, atlas in atlases.items():
        print(f"{name:<8} {' x '.join(map(str, atlas.areas.shape))} texels")
    for backend in ("cpu", "gl"):
        try:
            rivals = {name: backend_advance(backend, each) for name, each in operators.items()}
        except GLError as error:
            print(f"{backend}: {error}")
            continue
        seconds = race(rivals)
        ratios = np.divide(seconds["patches"], seconds["cube"])
        ratio = np.median(ratios) * atlases["cube"].areas.size / atlases["patches"].areas.size
        print(f"{backend}: patches over cube, a texel: {ratio:.2f}")
    draw = {name: frames(mesh, atlas, (width, height)) for name, atlas in atlases.items()}
    print(f"frame of {options.size}: patches over cube: {frame_ratio(draw, options.frames):.2f}")


if __name__ == "__main__":
    main()
