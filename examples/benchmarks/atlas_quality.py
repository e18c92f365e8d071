"""How good and how quick are the atlases of all the meshes in a folder?

    python examples/benchmarks/atlas_quality.py FOLDER [--resolution 96] [--method
    progressive|conformal]

One line a mesh: folded triangles, stretch below which 99.9 % of the area lies (1 is an even spread
of texels), starved area, texel area over mesh area, the stable time step relative to that of an
even square grid with as many texels on the same area, and the seconds that reading, sphere map,
rays and a second atlas from the cache took.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

from ripple_sim.solver import RippleError, WaveSolver, build_atlas, load_mesh
from ripple_sim.solver.operator import SAFETY

ROW = "{:<24} {:>8} {:>6} {:>7} {:>8} {:>9} {:>10} {:>7} {:>11} {:>6} {:>7}"


def even_grid_timestep(area: float, texels: int) -> float:
    """Stable step [s] at 1 m/s on squares of side h: the solver's share of 2 / sqrt(8 / h^2)."""
    return SAFETY * np.sqrt(area / texels / 2)


def line(path: Path, resolution: int, method: str) -> str:
    start = time.perf_counter()
    mesh = load_mesh(path)
    loaded = time.perf_counter() - start
    atlas = build_atlas(mesh, resolution, method, layout="cube")
    cached = build_atlas(mesh, resolution, method, layout="cube")
    quality = atlas.quality()
    seconds = atlas.timings
    step = WaveSolver(atlas, backend="cpu").stable_timestep / even_grid_timestep(
        mesh.area, atlas.areas.size
    )
    return ROW.format(
        path.name,
        len(mesh.F),
        quality["flipped"],
        f"{quality['q999']:.2f}",
        f"{quality['starved']:.2%}",
        f"{quality['coverage']:.4f}",
        f"{step:.3f}",
        f"{loaded:.2f}",
        f"{seconds['sphere_map']:.2f}",
        f"{seconds['rays']:.2f}",
        f"{cached.timings['cache']:.3f}",
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Quality and times of the atlases of all meshes in a folder."
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--resolution", type=int, default=96)
    parser.add_argument("--method", default="progressive")
    options = parser.parse_args()
    print(
        ROW.format(
            "mesh",
            "faces",
            "folded",
            "99.9 %",
            "starved",
            "coverage",
            "time step",
            "read",
            "sphere map",
            "rays",
            "cache",
        )
    )
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder  # what an earlier run left behind must not count
        for path in sorted(options.folder.iterdir()):
            if path.suffix.lower() in (".obj", ".off", ".ply", ".stl", ".glb"):
                try:
                    print(line(path, options.resolution, options.method), flush=True)
                except RippleError as error:
                    print(f"{path.name:<24} {error}", flush=True)


if __name__ == "__main__":
    main()
