"""How much quicker is an atlas than by exhaustive rays, and than building it again?

    python examples/benchmarks/atlas.py MESH [--resolution 512] [--rays 64]

The paper casts every texel's ray against every triangle. That takes hours, so a few rays are timed
and the rest is reckoned from them. Each figure is the least of several runs; the compiled kernels
are warm.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import build_atlas, load_mesh
from ripple_sim.solver.layouts.cube import texel_directions


def cast_rays_exhaustively(
    sphere: NDArray[np.float64], F: NDArray[np.int64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Intersect rays from the origin with all triangles: the slow and simple oracle.

    The method is that of Moeller and Trumbore (1997). Parameters and results are those of
    `cast_rays`. The cost is the number of rays times the number of triangles. Where a ray meets
    several triangles on a shared edge, the triangle in which the ray lies deepest is taken.
    """
    corner = sphere[F[:, 0]]
    edge1 = sphere[F[:, 1]] - corner
    edge2 = sphere[F[:, 2]] - corner
    to_origin = -corner
    q = np.cross(to_origin, edge1)
    triangles = np.empty(len(directions), dtype=np.int64)
    barycentrics = np.empty((len(directions), 3))
    for i, direction in enumerate(directions):
        p = np.cross(direction, edge2)
        determinant = np.einsum("ij,ij->i", edge1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", to_origin, p) / determinant
            v = q @ direction / determinant
            distance = np.einsum("ij,ij->i", edge2, q) / determinant
            inside = np.minimum(np.minimum(u, v), 1 - u - v)
        depth = np.where((distance > 0) & np.isfinite(inside), inside, -np.inf)
        hit = int(np.argmax(depth))
        triangles[i] = hit
        barycentrics[i] = (1 - u[hit] - v[hit], u[hit], v[hit])
    return triangles, barycentrics


def seconds(runs: int, work: Callable[[], Any]) -> float:
    least = np.inf
    for _ in range(runs):
        start = time.perf_counter()
        work()
        least = min(least, time.perf_counter() - start)
    return least


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Times of an atlas: whole, from the cache, by exhaustive rays."
    )
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--rays", type=int, default=64, help="exhaustive rays to time")
    options = parser.parse_args()
    mesh = load_mesh(options.mesh)
    n = options.resolution
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder  # what an earlier run left behind must not count
        atlas = build_atlas(mesh, 8, cache=False, layout="cube")
        whole = seconds(3, lambda: build_atlas(mesh, n, cache=False, layout="cube"))
        build_atlas(mesh, n, layout="cube")
        cached = seconds(3, lambda: build_atlas(mesh, n, layout="cube"))
    directions = np.random.default_rng(0).permutation(texel_directions(n).reshape(-1, 3))[
        : options.rays
    ]
    a_ray = (
        seconds(3, lambda: cast_rays_exhaustively(atlas.sphere, mesh.F, directions)) / options.rays
    )
    exhaustive = 6 * n * n * a_ray
    print(f"{options.mesh.name}: {len(mesh.F)} triangles, N = {n}, {6 * n * n} texels")
    print(f"whole atlas       {whole:10.2f} s")
    print(f"from the cache    {cached:10.3f} s   {whole / cached:8.0f} times quicker")
    print(
        f"exhaustive rays   {exhaustive:10.0f} s   {exhaustive / whole:8.0f} times slower (from "
        f"{options.rays} rays)"
    )


if __name__ == "__main__":
    main()
