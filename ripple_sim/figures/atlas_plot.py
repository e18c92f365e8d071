"""A figure of an atlas: the mesh with the texel grid, the charts, stretch and quality."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .atlas_view import AtlasPainter
from .chart_images import cross, sphere_image, squares
from .plot_page import FAINT, TEXT, check_plot_path, dressed, save_plot, show
from .texel_colors import STRETCH_COLORS, STRETCH_RANGE, chart_colors, stretch_colors, stretch_shade, texel_stretch
from .view import View


def plot_atlas(atlas: Atlas, path: str | Path, *, title: str, subtitle: str = "", up: str = "y") -> None:
    """Write a figure of an atlas and its quality.

    Parameters
    ----------
    atlas : Atlas
    path : path
        Ends in .png, .jpg, .pdf or .svg.
    title, subtitle : str
    up : str
        Axis of the mesh that points up in the figure, "y" or "z".

    Raises
    ------
    AtlasError
        If the ending is unknown or the file cannot be written.
    """
    check_plot_path(path)
    stretch = texel_stretch(atlas)
    figure = dressed(title, subtitle)
    painter = AtlasPainter(atlas, stretch_colors(stretch))
    front, back = View(up=up), View(azimuth=View.azimuth + 180, up=up)
    if atlas.layout == "cube":
        show(figure, (0.025, 0.05, 0.37, 0.82), painter.mesh(front, 800))
        show(figure, (0.42, 0.50, 0.20, 0.38), painter.mesh(back, 400), "the other side")
        sphere = sphere_image(painter, atlas.resolution, front, 380)
        show(figure, (0.42, 0.07, 0.20, 0.355), sphere, "on the sphere")
        show(figure, (0.635, 0.455, 0.35, 0.47), cross(painter, atlas.resolution, 160), "the six charts, unfolded")
    else:
        colors = np.broadcast_to(chart_colors(atlas.texels.topology)[:, None, None], (*atlas.texels.shape, 3))
        charts = AtlasPainter(atlas, colors)
        show(figure, (0.025, 0.05, 0.37, 0.82), charts.mesh(front, 800))
        show(figure, (0.42, 0.50, 0.20, 0.38), charts.mesh(back, 400), "the other side")
        show(figure, (0.42, 0.07, 0.20, 0.355), painter.mesh(front, 380), "stretch")
        page = squares(painter, atlas.texels.shape, 672, 508)
        show(figure, (0.635, 0.455, 0.35, 0.47), page, f"the {atlas.texels.shape[0]} charts, side by side")
    _histogram(figure.add_axes((0.655, 0.300, 0.31, 0.105)), stretch, atlas.areas)
    _figures(figure, atlas)
    save_plot(figure, path)


def _histogram(axes: Axes, stretch: NDArray[np.float64], areas: NDArray[np.float64]) -> None:
    """Share of the surface over stretch, in the colours of the images, as their legend."""
    bins = np.geomspace(1 / STRETCH_RANGE, STRETCH_RANGE, 121)
    share, _ = np.histogram(stretch.clip(bins[0], bins[-1]), bins, weights=areas)
    middles = np.sqrt(bins[1:] * bins[:-1])
    colors = STRETCH_COLORS(stretch_shade(middles))
    axes.bar(bins[:-1], share / share.max(), np.diff(bins), align="edge", color=colors, edgecolor="none")
    axes.stairs(share / share.max(), bins, color=FAINT, linewidth=0.7)  # pale bars need an outline
    axes.bar(bins[:-1], -0.14, np.diff(bins), bottom=-0.03, align="edge", color=colors, edgecolor="none")
    axes.set_xscale("log")
    axes.set_xlim(bins[0], bins[-1])
    axes.set_ylim(-0.17, 1.02)
    ticks = [0.5, 0.6, 0.7, 0.8, 1.0, 1.25, 1.5, 2.0]
    axes.set_xticks(ticks, ["≤ ½", *(f"{t:g}" for t in ticks[1:-1]), "≥ 2"], fontsize=10, color=TEXT)
    axes.set_xticks([], minor=True)
    axes.set_yticks([])
    axes.tick_params(length=0, pad=3)
    axes.set_xlabel("stretch: texel width relative to an even spread", fontsize=11.5, color=FAINT)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _figures(figure: Figure, atlas: Atlas) -> None:
    quality = atlas.quality()
    even = np.sqrt(atlas.mesh.area / atlas.areas.size)
    shown = {
        "folded triangles": ("{flipped}", 1.0),
        "area starved (stretch over 4)": ("{starved:.2f} %", 100.0),
        "texel area / mesh area": ("{coverage:.4f}", 1.0),
        "stretch, median": ("{q50:.2f}", 1.0),
        "stretch, 0.1 % to 99.9 %": ("{q001:.2f} to {q999:.2f}", 1.0),
        "texel edges / even grid": ("{edge_min:.2f} to {edge_max:.2f}", 1 / even),
    }
    for index, (name, (form, unit)) in enumerate(shown.items()):
        left, k = (0.655, 0.83)[index // 3], index % 3
        values = {key: value if unit == 1.0 else value * unit for key, value in quality.items()}
        try:
            text = form.format(**values)
        except KeyError:  # the layout does not know it
            text = "-"
        figure.text(left, 0.196 - 0.062 * k, text, fontsize=16, fontweight="bold", color=TEXT, va="center")
        figure.text(left, 0.170 - 0.062 * k, name, fontsize=11, color=FAINT, va="center")
