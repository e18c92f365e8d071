"""Wave fronts against geodesic circles: lines of equal arrival time on the surface.

    python examples/plots/wave_fronts.py [MESH] [--resolution 96] [--up y|z]

writes out/plots/wave_fronts.png. The dark lines are the measured fronts at equal times, the wide
pale bands the circles of exact geodesic distance that they should run along; colour tells where a
front is ahead or behind.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from figure import FAINT, FOLDER, NAMES, TEXT, save, sheet
from matplotlib.colors import ListedColormap

from ripple_sim.figures import AtlasPainter, View
from ripple_sim.overlay import color_table, colors
from ripple_sim.scene import usual_up
from ripple_sim.solver import Atlas, build_atlas, load_mesh
from ripple_sim.solver.texels import sampling_matrix

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from arrival import (
    NEAREST,
    front_and_crest,
    geodesic_distance,
    ideal_width,
    plane_arrival,
    waves_of,
)

MESH = Path(__file__).parents[2] / "scenes" / "meshes" / "duck.obj"
VIEW = {"azimuth": 38.0, "elevation": 24.0}
LIMIT = 0.25  # relative error at the ends of the colours
CIRCLES = 12  # from the source to the farthest point
BAND = np.array([1.0, 0.82, 0.36])
LINE = 0.045
INK = np.array([0.07, 0.09, 0.14])


class FrontPainter(AtlasPainter):
    """Draws the fronts: fields on the texels of the exact and of the measured distance."""

    def __init__(
        self, atlas: Atlas, distance: np.ndarray, gone: np.ndarray, spacing: float, nearest: float
    ) -> None:
        super().__init__(atlas, np.ones((*distance.shape, 3)))
        self._fields = np.stack([distance.ravel(), gone.ravel()], axis=1)
        self._spacing = spacing
        self._nearest = nearest
        self._topology = atlas.texels.topology

    def paint(self, chart: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        distance, gone = (sampling_matrix(self._topology, chart, row, column) @ self._fields).T
        far = distance > self._nearest
        painted = colors(np.where(far, gone / np.maximum(distance, 1e-9) - 1, 0), LIMIT) / 255
        # the gradient of a distance is 1: lines between two of its values have one width
        circle, front = (np.abs((d / self._spacing + 0.5) % 1 - 0.5) for d in (distance, gone))
        for near, ink, strength in ((circle < 2.4 * LINE, BAND, 0.85), (front < LINE, INK, 0.9)):
            weight = (near & far)[:, None] * strength
            painted = painted * (1 - weight) + ink * weight
        painted[distance < 0.18 * self._spacing] = INK  # the source
        return painted


def fields(atlas: Atlas, source: int, operator: str) -> tuple[np.ndarray, np.ndarray]:
    """Exact geodesic distance of the texels from a vertex, and the distance of the front."""
    mesh = atlas.mesh
    exact = geodesic_distance(mesh, source)
    # NaN on other parts of the mesh, where no front ever comes and none is expected: they are
    # painted plain
    exact[~np.isfinite(exact)] = np.nan
    distance = (exact[mesh.F[atlas.triangles]] * atlas.barycentrics).sum(axis=-1)
    farthest = float(np.nanmax(distance))
    width = ideal_width(atlas)
    probes = atlas.chart_map.coordinates(
        mesh, atlas.triangles.ravel(), atlas.positions.reshape(-1, 3)
    )
    front, _ = front_and_crest(*waves_of(atlas, mesh.V[source], probes, width, farthest, operator))
    # a front on the plane is a little behind its distance: read off where it would be by now
    grid = np.linspace(NEAREST - 1, farthest / width * 1.3, 400)
    gone = np.interp(front / width, plane_arrival(grid)[0], grid) * width
    return distance, np.where(np.isfinite(gone), gone, 0.0).reshape(distance.shape)


def make(
    folder: Path, mesh: Path = MESH, resolution: int = 96, up: str = "z", size: int = 620
) -> Path:
    atlas = build_atlas(load_mesh(mesh), resolution)
    view = View(**VIEW, up=up)
    source = int(np.argmax(atlas.mesh.V @ (view.axes[2] + 0.9 * view.axes[1] + 0.2 * view.axes[0])))
    figure = sheet(
        16.0,
        5.6,
        "Wave fronts and geodesic circles",
        f"{mesh.stem}, {' x '.join(map(str, atlas.areas.shape))} texels; fronts at equal times "
        f"(dark) over circles of "
        "exact geodesic distance (yellow), from the black point",
    )
    nearest = NEAREST * ideal_width(atlas)
    for column, operator in enumerate(NAMES):
        distance, gone = fields(atlas, source, operator)
        painter = FrontPainter(atlas, distance, gone, float(np.nanmax(distance)) / CIRCLES, nearest)
        left = 0.012 + 0.232 * column
        axes = figure.add_axes((left, 0.10, 0.225, 0.74))
        axes.imshow(painter.mesh(view, size), interpolation="antialiased")
        axes.set_axis_off()
        error = np.abs(gone / distance - 1)[distance > nearest]
        figure.text(
            left + 0.112,
            0.085,
            NAMES[operator],
            fontsize=13,
            fontweight="bold",
            color=TEXT,
            ha="center",
        )
        figure.text(
            left + 0.112,
            0.04,
            f"median error {100 * np.median(error):.2f} %",
            fontsize=10.5,
            color=FAINT,
            ha="center",
        )
    bar = figure.add_axes((0.951, 0.2, 0.009, 0.52))
    bar.imshow(
        np.linspace(1, 0, 256)[:, None], cmap=ListedColormap(color_table() / 255), aspect="auto"
    )
    bar.set_xticks([])
    ends = f"{100 * LIMIT:g} %"
    bar.set_yticks(
        [0, 127.5, 255], [f"+{ends}", "0", f"\N{MINUS SIGN}{ends}"], fontsize=9.5, color=TEXT
    )
    bar.yaxis.tick_right()
    bar.tick_params(length=0)
    bar.set_title("ahead", fontsize=9.5, color=FAINT)
    bar.set_xlabel("behind", fontsize=9.5, color=FAINT)
    for spine in bar.spines.values():
        spine.set_visible(False)
    return save(figure, folder, "wave_fronts")


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Wave fronts over a surface, and the circles they should follow."
    )
    parser.add_argument("mesh", type=Path, nargs="?", default=MESH)
    parser.add_argument("--resolution", type=int, default=96)
    parser.add_argument("--up", choices=("y", "z"), help="axis of the mesh that points up")
    options = parser.parse_args()
    up = options.up or ("z" if options.mesh == MESH else usual_up(options.mesh))
    print(make(FOLDER, options.mesh, options.resolution, up))


if __name__ == "__main__":
    main()
