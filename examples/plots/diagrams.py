"""The diagrams of docs/how-it-works.md: boxes and arrows, a grid of texels, and states.

    python examples/plots/diagrams.py

writes out/plots/data_flow.svg, texel_links.svg, contact_states.svg and frame_passes.svg; with
--docs it replaces the pictures in docs/pictures.
"""

import argparse
import os
from pathlib import Path

os.environ["SOURCE_DATE_EPOCH"] = "0"  # the same bytes each time

import matplotlib as mpl
import numpy as np
from figure import FAINT, FOLDER, HAIR, TEXT
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

DOCS = Path(__file__).parents[2] / "docs" / "pictures"

# faces and edges of boxes: the solver's, and those of ripple_sim
SOLVER = ("#e9f1f9", "#1f5fa8")
SIMULATION = ("#fbf6ee", "#b98b3e")
HIGHLIGHT = "#d1632f"

mpl.rcParams["svg.hashsalt"] = "ripple-sim"
mpl.rcParams["font.family"] = "DejaVu Sans"


def drawing(width: float, height: float) -> tuple[Figure, Axes]:
    """A figure with one axes in inches, without frame."""
    figure = Figure(figsize=(width, height), facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure, axes


def box(
    axes: Axes,
    place: tuple[float, float],
    title: str,
    words: str = "",
    colors: tuple[str, str] = SOLVER,
    size: tuple[float, float] = (2.0, 0.95),
) -> None:
    """A box with its centre at a place [inches]: a title, and words below."""
    x, y = place
    width, height = size
    face, edge = colors
    axes.add_patch(
        FancyBboxPatch(
            (x - width / 2, y - height / 2),
            width,
            height,
            boxstyle="round,pad=0,rounding_size=0.08",
            facecolor=face,
            edgecolor=edge,
            linewidth=1.1,
            zorder=3,
        )
    )
    lines = words.count("\n") + 1 if words else 0
    axes.text(
        x,
        y + 0.085 * lines,
        title,
        fontsize=10,
        fontweight="bold",
        color=TEXT,
        ha="center",
        va="center",
        zorder=4,
    )
    axes.text(
        x,
        y - 0.1,
        words,
        fontsize=8.2,
        color=TEXT,
        ha="center",
        va="center",
        linespacing=1.3,
        zorder=4,
    )


def arrow(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    words: str = "",
    bend: float = 0.0,
    shift: tuple[float, float] = (0.0, 0.13),
) -> None:
    """An arrow between two points [inches], with words beside its middle."""
    style = {
        "arrowstyle": "-|>",
        "color": FAINT,
        "linewidth": 1.3,
        "connectionstyle": f"arc3,rad={bend}",
        "shrinkA": 0,
        "shrinkB": 0,
    }
    axes.annotate("", end, start, arrowprops=style, zorder=2)
    x = (start[0] + end[0]) / 2 + shift[0]
    y = (start[1] + end[1]) / 2 + shift[1]
    axes.text(x, y, words, fontsize=8, color=TEXT, ha="center", va="center", linespacing=1.25)


def data_flow() -> Figure:
    """From a mesh file and a MuJoCo model to a video."""
    figure, axes = drawing(9.6, 3.7)
    x = [1.25, 3.7, 6.15, 8.35]
    top, bottom = 2.75, 0.9
    box(axes, (x[0], top), "mesh", "V, F of a mesh file,\nmade a manifold")
    box(axes, (x[1], top), "layout", "cube or patches:\ncharts without folds")
    box(axes, (x[2], top), "atlas", "a surface point\nfor each texel")
    box(axes, (x[3], top), "operator", "finite elements\non texel centres")
    box(axes, (x[0], bottom), "MuJoCo", "mj_step:\ncontact forces [N]", SIMULATION)
    box(axes, (x[1], bottom), "coupling", "impulses [N s] at the\ntrue surface", SIMULATION)
    box(axes, (x[2], bottom), "waves", "leapfrog steps\non CPU or GPU")
    box(axes, (x[3], bottom), "renderer", "displaced surface,\nframes, video", SIMULATION)
    for left, right in ((0, 1), (1, 2), (2, 3)):
        arrow(axes, (x[left] + 1.02, top), (x[right] - 1.02, top))
        arrow(axes, (x[left] + 1.02, bottom), (x[right] - 1.02, bottom))
    arrow(axes, (x[3] - 0.4, top - 0.5), (x[2] + 0.5, bottom + 0.5), "weights", shift=(0.4, 0.0))
    for y, words in ((top + 0.72, "once for each mesh"), (bottom - 0.72, "in each step")):
        axes.text(0.25, y, words, fontsize=9, color=FAINT, va="center")
    return figure


def texel_links() -> Figure:
    """Links of a texel inside a chart, at the border of two charts, and where three meet."""
    figure, axes = drawing(9.6, 3.5)
    cell = 0.52
    _regular_links(axes, np.array([0.55, 0.65]), cell)
    _border_links(axes, np.array([3.7, 0.65]), cell)
    _corner_links(axes, np.array([8.0, 1.75]), cell)
    titles = ((1.6, "inside a chart"), (5.0, "across a border"), (8.0, "where three charts meet"))
    for x, title in titles:
        axes.text(x, 3.22, title, fontsize=10, fontweight="bold", color=TEXT, ha="center")
    words = (
        (1.6, "8 neighbours, 9 weights"),
        (5.0, "the halo copies the neighbours"),
        (8.0, "a triangle beside the quads"),
    )
    for x, line in words:
        axes.text(x, 0.2, line, fontsize=8.5, color=FAINT, ha="center")
    return figure


def _texel(axes: Axes, place: np.ndarray, color: str = "#1f5fa8", size: float = 34) -> None:
    axes.scatter(*place, s=size, color=color, zorder=5)


def _regular_links(axes: Axes, corner: np.ndarray, cell: float) -> None:
    """A texel with its eight neighbours on a grid of 4 x 4 cells."""
    for i in range(5):
        axes.plot(corner[0] + cell * np.array([0, 4]), [corner[1] + cell * i] * 2, color=HAIR)
        axes.plot([corner[0] + cell * i] * 2, corner[1] + cell * np.array([0, 4]), color=HAIR)
    centre = corner + cell * np.array([1.5, 2.5])
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            neighbour = centre + cell * np.array([column, row])
            axes.plot(*np.array([centre, neighbour]).T, color=HIGHLIGHT, linewidth=1.3, zorder=4)
    for row in range(4):
        for column in range(4):
            _texel(axes, corner + cell * (np.array([column, row]) + 0.5))
    _texel(axes, centre, HIGHLIGHT, 50)


def _border_links(axes: Axes, corner: np.ndarray, cell: float) -> None:
    """Two charts: a texel at the border has neighbours in the other chart."""
    for chart, (x, face) in enumerate(((0.0, "#e9f1f9"), (2.5, "#fdf0e9"))):
        size = 2.5 * cell
        axes.add_patch(
            mpl.patches.Rectangle(
                (corner[0] + x * cell, corner[1]), size, 4 * cell, facecolor=face, edgecolor=FAINT
            )
        )
        color = "#1f5fa8" if chart == 0 else "#b98b3e"
        for row in range(4):
            for column in range(2):
                along = 0.5 + column if chart else 1.0 + column
                _texel(axes, corner + cell * np.array([x + along, row + 0.5]), color)
    centre = corner + cell * np.array([2.0, 1.5])
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            neighbour = centre + cell * np.array([column, row])
            axes.plot(*np.array([centre, neighbour]).T, color=HIGHLIGHT, linewidth=1.3, zorder=4)
    _texel(axes, centre, HIGHLIGHT, 50)


def _corner_links(axes: Axes, middle: np.ndarray, cell: float) -> None:
    """Three charts at a corner of the cube; the three innermost texels make a triangle."""
    faces = ("#e9f1f9", "#fdf0e9", "#edf5ec")
    colors = ("#1f5fa8", "#b98b3e", "#3f7d4f")
    innermost = []
    for chart in range(3):
        first, second = (
            np.array([np.cos(angle), np.sin(angle)]) * 2.4 * cell
            for angle in np.radians([90 + 120 * chart, 210 + 120 * chart])
        )
        outline = middle + np.array([[0, 0], first, first + second, second])
        axes.fill(*outline.T, facecolor=faces[chart], edgecolor=FAINT)
        for row in range(2):
            for column in range(2):
                place = middle + first * (0.25 + 0.5 * row) + second * (0.25 + 0.5 * column)
                _texel(axes, place, colors[chart])
                if row == column == 0:
                    innermost.append(place)
    axes.plot(*np.array([*innermost, innermost[0]]).T, color=HIGHLIGHT, linewidth=2.0, zorder=4)


def contact_states() -> Figure:
    """The states of a contact in the rest filter, and what takes it from one to the next."""
    figure, axes = drawing(9.6, 3.6)
    places = {
        "inactive": (1.2, 2.7),
        "onset": (4.2, 2.7),
        "steady": (8.2, 2.7),
        "chattering": (8.2, 0.85),
        "open": (4.7, 0.85),
        "gone": (1.2, 0.85),
    }
    words = {
        "inactive": "no force",
        "onset": "force where it touches",
        "steady": "force at the mean place",
        "chattering": "force averaged over 20 ms\nat the mean place",
        "open": "the rest of what\naveraging held back",
        "gone": "the rest of what\naveraging held back",
    }
    for name, place in places.items():
        box(axes, place, name, words[name], SIMULATION, (2.1, 0.9))
    arrow(axes, (2.28, 2.7), (3.12, 2.7), "touches")
    arrow(axes, (5.28, 2.7), (7.12, 2.7), "0.1 s without a break")
    arrow(axes, (4.3, 2.22), (4.6, 1.33), "opens", shift=(0.3, 0.0))
    arrow(axes, (7.6, 2.22), (5.6, 1.33), "opens", shift=(-0.25, 0.1))
    arrow(axes, (5.78, 0.95), (7.12, 0.95), "closes again", shift=(0.0, 0.13))
    arrow(axes, (7.12, 0.7), (5.78, 0.7), "opens", shift=(0.0, -0.14))
    arrow(axes, (3.62, 0.85), (2.28, 0.85), "after 5 ms")
    arrow(axes, (1.2, 1.33), (1.2, 2.22))
    return figure


def frame_passes() -> Figure:
    """From a snapshot of the simulation to an encoded frame."""
    figure, axes = drawing(9.6, 1.75)
    steps = (
        ("shadow maps", "depth from\neach light"),
        ("G-buffer", "normal, colour and\ndepth of each sample"),
        ("lighting", "once a sample;\nfloor and sky"),
        ("means", "exposures, lens,\ntone mapping"),
        ("read-back", "overlays,\nencoder"),
    )
    for i, (title, words) in enumerate(steps):
        x = 1.0 + 1.9 * i
        box(axes, (x, 0.95), title, words, SIMULATION, (1.62, 1.0))
        if i:
            arrow(axes, (x - 1.08, 0.95), (x - 0.82, 0.95))
    return figure


FIGURES = {
    "data_flow": data_flow,
    "texel_links": texel_links,
    "contact_states": contact_states,
    "frame_passes": frame_passes,
}


def make(folder: Path) -> list[Path]:
    """Write all diagrams as SVG."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in FIGURES.items():
        path = folder / f"{name}.svg"
        draw().savefig(path, metadata={"Date": None})
        paths.append(path)
    return paths


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", action="store_true", help="replace the pictures in docs/")
    for written in make(DOCS if parser.parse_args().docs else FOLDER):
        print(written)
