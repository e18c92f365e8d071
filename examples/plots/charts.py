"""From a mesh to its texels, and from a contact to a wave: two pictures of docs/how-it-works.md.

    python examples/plots/charts.py

writes out/plots/charts.png and out/plots/impulse.png; with --docs also the WebP pictures in
docs/pictures.
"""

import argparse
from pathlib import Path

import numpy as np
from figure import COLORS, FAINT, FOLDER, TEXT, plain, save, sheet
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.solver import (
    Material,
    WaveSolver,
    build_atlas,
    load_mesh,
    sphere_atlas,
)
from ripple_sim.solver.layouts.cube.convention import texel_directions

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs" / "pictures"
MESHES = ROOT / "scenes" / "meshes"
TEXELS = 24  # along a chart's side in the pictures
# one colour a chart, in turns
CHART_COLORS = ("#5b8ec2", "#d99a6c", "#8fb08c", "#c2b36b", "#a98fc0", "#c98a94")
VIEW = (-60, 28)  # azimuth and elevation of the eye [degrees]
LIGHT = np.array([0.4, -0.7, 0.6]) / np.linalg.norm([0.4, -0.7, 0.6])


def charts_figure() -> Figure:
    """A duck, its sphere map, its texels, and the patches of a pretzel."""
    figure = sheet(
        13.0,
        4.3,
        "From a mesh to its texels",
        "one colour a chart; the quads join the centres of neighbouring texels",
    )
    duck = load_mesh(MESHES / "duck.obj")
    atlas = build_atlas(duck, resolution=TEXELS, layout="cube")
    pretzel = build_atlas(load_mesh(MESHES / "pretzel.obj"), resolution=40, layout="patches")
    panels = (
        ("the mesh", duck.V[duck.F], np.zeros(len(duck.F), int)),
        ("its sphere map, six charts", *_quads(texel_directions(TEXELS))),
        ("the texels on the mesh", *_quads(atlas.positions)),
        ("patches, for any surface", *_quads(pretzel.positions)),
    )
    for i, (title, polygons, chart) in enumerate(panels):
        axes = figure.add_axes((0.005 + 0.25 * i, 0.0, 0.24, 0.76), projection="3d")
        _draw(axes, polygons, chart, edges=i > 0)
        axes.set_title(title, fontsize=11, color=TEXT, y=0.99)
    return figure


def _quads(positions: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Quads between texel centres [C, n, n, 3] as polygons [k, 4, 3], and the chart of each [k]."""
    corners = (
        positions[:, :-1, :-1],
        positions[:, :-1, 1:],
        positions[:, 1:, 1:],
        positions[:, 1:, :-1],
    )
    quads = np.stack(corners, axis=3)
    chart = np.arange(len(positions))[:, None, None] * np.ones(quads.shape[:3], int)
    return quads.reshape(-1, 4, 3), chart.ravel()


def _draw(axes: Axes, polygons: NDArray[np.float64], chart: NDArray[np.int64], edges: bool) -> None:
    """Draw shaded polygons that face the viewer."""
    normals = np.cross(polygons[:, 1] - polygons[:, 0], polygons[:, 2] - polygons[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-30
    azimuth, elevation = np.radians(VIEW)
    eye = [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]
    front = normals @ np.array(eye) > 0
    shade = 0.62 + 0.38 * np.clip(normals[front] @ LIGHT, 0, 1)
    palette = np.array([to_rgb(color) for color in CHART_COLORS])
    colors = palette[chart[front] % len(palette)] * shade[:, None]
    axes.add_collection3d(
        Poly3DCollection(
            polygons[front],
            facecolors=colors,
            edgecolors=(1, 1, 1, 0.45) if edges else colors,
            linewidths=0.3,
        )
    )
    low = polygons.min(axis=(0, 1))
    high = polygons.max(axis=(0, 1))
    middle = (low + high) / 2
    half = 0.34 * np.linalg.norm(high - low)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_zlim(middle[2] - half, middle[2] + half)
    axes.set_box_aspect((1, 1, 1), zoom=1.3)
    axes.view_init(VIEW[1], VIEW[0])
    axes.set_axis_off()


def impulse_figure() -> Figure:
    """A contact, the footprint of its impulse, and the wave, along an arc of a sphere."""
    figure = sheet(
        13.0,
        4.6,
        "From a contact to a wave",
        "a ball hits a sphere of 1 m: contact force, footprint of the impulse, ring",
    )
    _draw_contact(figure.add_axes((0.03, 0.05, 0.27, 0.67)))
    atlas = sphere_atlas(1.0, 96)
    angle = np.degrees(np.arccos(np.clip(atlas.positions[..., 2], -1, 1))).ravel()
    waves = WaveSolver(atlas, Material(speed=1.0, density=10.0), backend="cpu")
    waves.add_impulse([0.0, 0.0, 1.0], impulse=0.2, radius=0.15)
    axes = figure.add_axes((0.365, 0.14, 0.27, 0.58))
    plain(axes, "angle from the contact [degrees]", "velocity [m/s]")
    axes.set_title("2  the footprint gets the impulse", fontsize=11, color=TEXT, loc="left")
    axes.plot(*_profile(angle, waves.velocity.ravel(), 40), color=COLORS["fem"], linewidth=2.0)
    axes = figure.add_axes((0.715, 0.14, 0.27, 0.58))
    plain(axes, "angle from the contact [degrees]", "height [mm]")
    axes.set_title("3  the wave runs over the surface", fontsize=11, color=TEXT, loc="left")
    for time, color in ((0.25, "#9fc0e0"), (0.6, "#5b8ec2"), (1.2, COLORS["fem"])):
        waves.step(time - waves.time)
        profile = _profile(angle, 1e3 * waves.height.ravel(), 120)
        axes.plot(*profile, color=color, linewidth=2.0, label=f"{time:g} s")
    axes.legend(frameon=False, fontsize=9.5, labelcolor=TEXT, loc="lower right")
    return figure


def _profile(
    angle: NDArray[np.float64], values: NDArray[np.float32], end: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean of values over rings of one degree, and the rings' angles [degrees]."""
    ring = np.arange(0.0, end)
    count, _ = np.histogram(angle, [*ring, end])
    total, _ = np.histogram(angle, [*ring, end], weights=values)
    used = count > 0
    return ring[used] + 0.5, total[used] / count[used]


def _draw_contact(axes: Axes) -> None:
    """A ball on a surface: MuJoCo's contacts, and the point of their mean by force."""
    axes.set_xlim(-1.6, 1.6)
    axes.set_ylim(-1.25, 1.75)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title("1  MuJoCo's contacts", fontsize=11, color=TEXT, loc="left")
    x = np.linspace(-1.5, 1.5, 100)
    surface = np.sqrt(9 - x**2) - 3
    axes.fill_between(x, surface, -1.2, color="#e9f1f9")
    axes.plot(x, surface, color=COLORS["fem"], linewidth=2.0)
    axes.add_patch(Circle((0.0, 0.62), 0.62, facecolor="#fbf6ee", edgecolor="#b98b3e"))
    axes.text(0.0, 0.8, "ball", ha="center", fontsize=10, color=TEXT)
    for place, force in ((-0.18, 0.3), (0.12, 0.5)):
        axes.annotate(
            "",
            (place, -0.05 - force),
            (place, -0.05),
            arrowprops={"arrowstyle": "-|>", "color": FAINT, "linewidth": 1.3},
        )
        axes.scatter(place, -0.02, s=18, color=FAINT, zorder=5)
    axes.scatter(0.008, -0.02, s=55, color=COLORS["paper"], zorder=6)
    axes.annotate(
        "$J = \\sum F_n\\,\\Delta t$\nat the mean point",
        (0.03, -0.04),
        (0.6, -0.75),
        fontsize=10.5,
        color=TEXT,
        arrowprops={"arrowstyle": "-", "color": COLORS["paper"], "linewidth": 1.0},
    )


def make(folder: Path) -> dict[str, Path]:
    """Write both pictures, by name."""
    figures = {"charts": charts_figure(), "impulse": impulse_figure()}
    return {name: save(figure, folder, name) for name, figure in figures.items()}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", action="store_true", help="replace the pictures in docs/, too")
    arguments = parser.parse_args()
    for name, path in make(FOLDER).items():
        print(path)
        if arguments.docs:
            Image.open(path).convert("RGB").save(DOCS / f"{name}.webp", quality=88, method=6)
