"""How exact are whole waveforms? Heights over time, against finite elements on the mesh itself.

    python examples/benchmarks/waveforms.py [MESH ...] [--resolution 64] [--width 8]

A bump so many texels wide, the deviation of a Gaussian, is let go at a vertex, and its wave
followed until it has passed the farthest one; five receivers lie at equal shares of the area. The
elements are linear with lumped masses, with two vertices or more in a texel's width; texels are in
the cube layout where a mesh fits it. Columns: the layout, how far the receiver is from the source
along the surface, in widths of the bump, the correlation of the two waveforms over the whole time,
and their difference over the elements' in the L2 norm.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from arrival import (
    WIDTH,
    elements_waves,
    geodesic_distance,
    ideal_width,
    paper_atlas,
    spread_sources,
    vertex_coordinates,
    waves_of,
)

from ripple_sim.bench import table
from ripple_sim.solver import Mesh, load_mesh

MESHES = [
    Path(__file__).parents[2] / "scenes" / "meshes" / f"{name}.obj"
    for name in ("limbed", "pretzel")
]
RECEIVERS = 5


class Comparison(NamedTuple):
    """The wave at one receiver, compared with that of finite elements."""

    mesh: str
    layout: str
    distance: float  # from the source, in widths of the bump
    correlation: float
    difference: float  # in the L2 norm, over that of the finite elements

    def printed(self) -> list[str]:
        """The row of the table."""
        return [
            self.mesh,
            self.layout,
            f"{self.distance:.1f}",
            f"{self.correlation:.4f}",
            f"{self.difference:.1%}",
        ]


def comparisons(name: str, mesh: Mesh, resolution: int, texels: float) -> list[Comparison]:
    """Compare the waves at each receiver; the bump is as wide as so many texels."""
    atlas = paper_atlas(mesh, resolution)
    width = texels / WIDTH * ideal_width(atlas)
    source, *receivers = spread_sources(mesh, RECEIVERS + 1)
    distance = geodesic_distance(mesh, source)
    farthest = float(distance[np.isfinite(distance)].max())
    _, exact = elements_waves(mesh, source, width, farthest, texels)
    _, ours = waves_of(atlas, mesh.V[source], vertex_coordinates(atlas)[receivers], width, farthest)
    found = []
    for vertex, wave, reference in zip(receivers, ours.T, exact[:, receivers].T, strict=True):
        correlation = np.corrcoef(wave, reference)[0, 1]
        difference = np.linalg.norm(wave - reference) / np.linalg.norm(reference)
        found.append(
            Comparison(name, atlas.layout, distance[vertex] / width, correlation, difference)
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="Waveforms against finite elements.")
    parser.add_argument("meshes", type=Path, nargs="*", default=MESHES)
    parser.add_argument("--resolution", type=int, default=64)
    parser.add_argument(
        "--width", type=float, default=8.0, help="of the bump, in texels of an even grid"
    )
    options = parser.parse_args()
    found = []
    for path in options.meshes:
        compared = comparisons(path.stem, load_mesh(path), options.resolution, options.width)
        found += [comparison.printed() for comparison in compared]
    print(table(["mesh", "layout", "distance", "correlation", "L2"], found))


if __name__ == "__main__":
    main()
