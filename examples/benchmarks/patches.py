"""How good and how quick is the patch layout? One line a mesh.

    python examples/benchmarks/patches.py [MESH or FOLDER ...] [--arrival-sources 2]

Without arguments: generated surfaces (sphere, torus, disk, hemisphere, a strip a hundred times as
long as wide) and meshes that are shipped. Columns: triangles; parts, handles and rims; charts and
texels along their sides at N = 128; folded texels at N = 48, 96 and 128; at N = 96 the area of the
texel mesh over that of the mesh, texel areas at 0.1 % and 99.9 % over the median, and the stable
time step over that of an even grid of as many texels; at N = 128 the seconds of processor time for
the layout and for its texels, once compiled, and how many times quicker the cache is. With
`--arrival-sources`, the error of the front's arrival against exact geodesics at N = 96, median and
90 %, in percent.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import arrival as arrivals
import numpy as np
import trimesh

import ripple_sim.scenes
from ripple_sim.solver import Atlas, Mesh, RippleError, build_atlas, load_mesh
from ripple_sim.solver.layouts.patches import atlas_from_patch_map, cells_for, patch_map

SHIPPED = ("pretzel", "duck", "limbed", "teapot")
RESOLUTIONS = (48, 96, 128)
HEAD = (
    "mesh",
    "triangles",
    "parts, handles, rims",
    "charts",
    "folded",
    "spanned",
    "areas",
    "step",
    "seconds",
    "cache",
)

T = TypeVar("T")


def grid(columns: int, rows: int, place: Callable) -> Mesh:
    """Squares cut into triangles; place takes two arrays from 0 to 1 to x, y, z.

    Points in one place become one.
    """
    a, b = np.meshgrid(np.arange(columns + 1) / columns, np.arange(rows + 1) / rows, indexing="ij")
    V = np.stack(np.broadcast_arrays(*place(a, b)), axis=-1).reshape(-1, 3)
    corner = np.arange(len(V)).reshape(columns + 1, rows + 1)
    p, q, r, s = (
        each.ravel()
        for each in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
    )
    F = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])
    merged = trimesh.Trimesh(V.round(12), F)  # without the triangles that are none
    return Mesh.from_arrays(merged.vertices, merged.faces[merged.nondegenerate_faces()])


def generated() -> Iterator[tuple[str, Mesh]]:
    turn = 2 * np.pi
    solid = trimesh.creation.icosphere(4)
    yield "sphere", Mesh.from_arrays(solid.vertices, solid.faces)
    yield (
        "torus",
        grid(
            80,
            40,
            lambda a, b: (
                (1 + 0.4 * np.cos(turn * b)) * np.cos(turn * a),
                (1 + 0.4 * np.cos(turn * b)) * np.sin(turn * a),
                0.4 * np.sin(turn * b),
            ),
        ),
    )
    yield "disk", grid(24, 96, lambda a, b: (a * np.cos(turn * b), a * np.sin(turn * b), 0.0))
    yield (
        "hemisphere",
        grid(
            24,
            96,
            lambda a, b: (
                np.sin(turn / 4 * a) * np.cos(turn * b),
                np.sin(turn / 4 * a) * np.sin(turn * b),
                np.cos(turn / 4 * a),
            ),
        ),
    )
    yield "strip", grid(400, 4, lambda a, b: (100.0 * a, b, 0.0))
    for name in SHIPPED:
        yield name, load_mesh(Path(ripple_sim.scenes.__path__[0]) / "meshes" / f"{name}.obj")


def named(paths: list[Path]) -> Iterator[tuple[str, Mesh]]:
    files = [
        each for path in paths for each in (sorted(path.rglob("*")) if path.is_dir() else [path])
    ]
    for file in files:
        if file.suffix.lower() in (".obj", ".off", ".ply", ".stl", ".glb"):
            yield file.stem, load_mesh(file)


def timed(function: Callable[..., T], *args: object) -> tuple[T, float]:
    start = time.process_time()
    return function(*args), time.process_time() - start


def cached_seconds(mesh: Mesh) -> float:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder  # what an earlier run left behind must not count
        build_atlas(mesh, RESOLUTIONS[-1], layout="patches")
        return timed(lambda: build_atlas(mesh, RESOLUTIONS[-1], layout="patches"))[1]


def arrival(atlas: Atlas, sources: int) -> str:
    errors = [
        arrivals.arrival(atlas, source).error()
        for source in arrivals.spread_sources(atlas.mesh, sources)
    ]
    median, q90 = (
        100 * np.mean([getattr(each, name) for each in errors])
        for name in ("front_median", "front_q90")
    )
    return f"{median:.2f} / {q90:.2f}"


def cells_of_line(name: str, mesh: Mesh, sources: int) -> list[str]:
    folded = []
    for resolution in RESOLUTIONS:
        layout, laid = timed(patch_map, mesh.V, mesh.F, cells_for(resolution))
        atlas, put = timed(atlas_from_patch_map, mesh, layout, resolution)
        quality = atlas.quality()
        folded.append(f"{quality['folded']}")
        if resolution == 96:
            low, high = np.quantile(atlas.areas / np.median(atlas.areas), [0.001, 0.999])
            shape = [
                f"{quality['spanned']:.3f}",
                f"{low:.2f} / {high:.1f}",
                f"{quality['timestep']:.2f}",
            ]
            front = [arrival(atlas, sources)] if sources else []
    topology = f"{mesh.components.max() + 1}, {int(mesh.genus.sum())}, {len(mesh.rims)}"
    charts = f"{atlas.areas.shape[0]} x {atlas.areas.shape[1]}^2"
    quicker = (laid + put) / cached_seconds(mesh)
    times = [f"{laid:.1f} + {put:.1f}", f"{quicker:.0f} x"]
    return [name, f"{len(mesh.F):,}", topology, charts, " / ".join(folded), *shape, *times, *front]


def row(entries: list[str]) -> str:
    return f"| {' | '.join(entries)} |"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("meshes", nargs="*", type=Path, help="files, or folders of them")
    parser.add_argument("--arrival-sources", type=int, default=0)
    args = parser.parse_args()
    warm = trimesh.creation.annulus(0.5, 1.0, 0.2)
    cells_of_line("", Mesh.from_arrays(warm.vertices, warm.faces), args.arrival_sources)  # compiles
    head = [*HEAD, *(["arrival"] if args.arrival_sources else [])]
    print(row(head), row(["---"] * len(head)), sep="\n")
    for name, mesh in named(args.meshes) if args.meshes else generated():
        try:
            print(row(cells_of_line(name, mesh, args.arrival_sources)), flush=True)
        except RippleError as error:
            print(f"{name}: {error}", flush=True)


if __name__ == "__main__":
    main()
