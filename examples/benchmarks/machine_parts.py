"""How long do meshes of machines take to get an atlas? One line a mesh.

    python examples/benchmarks/machine_parts.py [--resolution 48] [MESH ...]

Without meshes: a turned ring of 10,000 long triangles, 100,000 triangles in 100 different parts,
the same in 100 equal parts, and a ball with 10,000 crumbs round it. Columns: triangles, parts,
charts and texels along their sides, folded triangles, parts that lie still, and seconds of
processor time, once compiled.
"""

import argparse
import logging
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from ripple_sim.solver import Mesh, build_atlas, load_mesh

PARTS = 100
CRUMBS = 10_000


def ring(sections: int) -> trimesh.Trimesh:
    """A ring with eight triangles for each of its sections."""
    return trimesh.creation.annulus(r_min=0.5, r_max=1.0, height=0.3, sections=sections)


def in_rows(parts: list[trimesh.Trimesh]) -> Mesh:
    """Parts side by side, ten in a row."""
    V = []
    F = []
    first = 0
    for i, part in enumerate(parts):
        V.append(part.vertices + np.array([3.0 * (i % 10), 3.0 * (i // 10), 0.0]))
        F.append(part.faces + first)
        first += len(part.vertices)
    return Mesh.from_arrays(np.concatenate(V), np.concatenate(F))


def different_parts() -> Mesh:
    """Rods, rings, tori and ellipsoids of about a thousand triangles each."""
    random = np.random.default_rng(0)
    parts = []
    for i in range(PARTS):
        size = random.uniform(0.3, 1.0, 3)
        shapes = (
            lambda: trimesh.creation.cylinder(1.0, 1.0, sections=250),
            lambda: ring(125),
            lambda: trimesh.creation.torus(1.0, 0.3, major_sections=25, minor_sections=20),
            lambda: trimesh.creation.uv_sphere(1.0, count=(22, 24)),
        )
        part = shapes[i % len(shapes)]()
        part.vertices = part.vertices * size
        parts.append(part)
    return in_rows(parts)


def equal_parts() -> Mesh:
    """A hundred tori of a thousand triangles."""
    torus = trimesh.creation.torus(1.0, 0.3, major_sections=25, minor_sections=20)
    return in_rows([torus] * PARTS)


def ball_with_crumbs() -> Mesh:
    """A ball, and tetrahedra round it, each smaller than a texel."""
    random = np.random.default_rng(0)
    ball = trimesh.creation.icosphere(3)
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    places = random.normal(size=(CRUMBS, 1, 3))
    places *= random.uniform(1.1, 1.5, (CRUMBS, 1, 1)) / np.linalg.norm(
        places, axis=2, keepdims=True
    )
    crumbs = places + random.uniform(0.0005, 0.002, (CRUMBS, 1, 1)) * corners
    triangles = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    F = len(ball.vertices) + 4 * np.arange(CRUMBS)[:, None, None] + triangles
    return Mesh.from_arrays(
        np.concatenate([ball.vertices, crumbs.reshape(-1, 3)]),
        np.concatenate([ball.faces, F.reshape(-1, 3)]),
    )


MESHES: dict[str, Callable[[], Mesh]] = {
    "turned ring": lambda: Mesh.from_arrays(ring(1250).vertices, ring(1250).faces),
    "100 different parts": different_parts,
    "100 equal parts": equal_parts,
    "ball with 10,000 crumbs": ball_with_crumbs,
}


def line(name: str, mesh: Mesh, resolution: int) -> str:
    """Figures of one mesh."""
    start = time.process_time()
    atlas = build_atlas(mesh, resolution, cache=False)
    seconds = time.process_time() - start
    charts, n, _ = atlas.areas.shape
    flipped = atlas.quality()["flipped"]
    pieces = atlas.texture_coordinates()
    still_triangles = pieces.triangle[atlas.texels.topology.still[pieces.chart]]
    still = len(np.unique(mesh.components[still_triangles]))
    return (
        f"{name:24} {len(mesh.F):>9,} {mesh.component_count:>7,} {charts:>7,} x {n:<3} "
        f"{flipped:>6} {still:>7,} {seconds:>8.1f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Atlases of machines' meshes")
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--resolution", type=int, default=48)
    arguments = parser.parse_args()
    logging.getLogger("ripple_sim").setLevel(logging.ERROR)
    # compiles what is not in the cache yet
    build_atlas(in_rows([ring(8), ring(9)]), 16, cache=False)
    heads = ("mesh", "triangles", "parts", "charts", "folded", "still", "seconds")
    print("{:24} {:>9} {:>7} {:>13} {:>6} {:>7} {:>8}".format(*heads))
    for path in arguments.meshes:
        print(line(path.name, load_mesh(path), arguments.resolution), flush=True)
    if not arguments.meshes:
        for name, mesh in MESHES.items():
            print(line(name, mesh(), arguments.resolution), flush=True)


if __name__ == "__main__":
    main()
