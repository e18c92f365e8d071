"""What does a wave step cost in the patch layout, against the cube layout of the same mesh?

    python examples/benchmarks/layouts.py [MESH] [--resolution 128]

Seconds a substep and texel, patches over cube, so that a few texels more or less do not count; the two take turns, on
the CPU and, where there is OpenGL, in its compute shaders.
"""

import argparse
from pathlib import Path

import numpy as np

from ripple_sim.bench.speed import Advances, Waited, race
from ripple_sim.solver import GLError, Material, build_atlas, load_mesh
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.operator.assembly import build_operator

MESH = Path(__file__).parents[2] / "scenes" / "meshes" / "duck.obj"


def main() -> None:
    parser = argparse.ArgumentParser(description="Cost of a wave step, patch layout over cube layout.")
    parser.add_argument("mesh", type=Path, nargs="?", default=MESH)
    parser.add_argument("--resolution", type=int, default=128)
    options = parser.parse_args()
    mesh = load_mesh(options.mesh)
    atlases = {name: build_atlas(mesh, options.resolution, layout=name) for name in ("cube", "patches")}
    operators = {name: build_operator(atlas, Material(), "fem") for name, atlas in atlases.items()}
    for name, atlas in atlases.items():
        print(f"{name:<8} {' x '.join(map(str, atlas.areas.shape))} texels")
    for backend in ("cpu", "gl"):
        try:
            rivals: dict[str, Advances] = {k: Waited(make_backend(backend, each)) for k, each in operators.items()}
        except GLError as error:
            print(f"{backend}: {error}")
            continue
        seconds = race(rivals, 1).seconds
        ratios = np.divide(seconds["patches"], seconds["cube"])
        ratio = np.median(ratios) * atlases["cube"].areas.size / atlases["patches"].areas.size
        print(f"{backend}: patches over cube, a texel: {ratio:.2f}")


if __name__ == "__main__":
    main()
