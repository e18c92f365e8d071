"""`plot_thickness`: a figure of the thickness of a layer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .atlas_painter import AtlasPainter, View
from .figure_file import check_plot_path, dressed, save_plot, show

# A thin layer is dark, like bone near the skin in a scan.
_THICKNESS_COLORS = colormaps["viridis"]

# Quantiles of the thickness at the ends of the colours.
_SHOWN_QUANTILES = (0.005, 0.97)

# Range of the colours over the greatest thickness, at least: a layer may be even.
_MIN_COLOR_RANGE = 1e-9

# Bars of the histogram.
_BARS = 100

_MILLIMETRES = 1e3  # in a metre


def plot_thickness(
    atlas: Atlas,
    thickness: NDArray[np.float64],
    path: str | Path,
    *,
    title: str,
    subtitle: str = "",
    up: str = "y",
) -> None:
    """Write a figure of the thickness [m] of a layer, [C, n, n], from `thickness_map`.

    The other arguments are those of `plot_atlas`.
    """
    check_plot_path(path)
    low, high = np.quantile(thickness, _SHOWN_QUANTILES)
    shade = np.clip((thickness - low) / max(high - low, _MIN_COLOR_RANGE * high), 0, 1)
    painter = AtlasPainter(atlas, _THICKNESS_COLORS(shade)[..., :3], with_grid=False)
    figure = dressed(title, subtitle)
    front = View(up=up)
    back = View(azimuth=View.azimuth + 180, up=up)
    show(figure, (0.03, 0.17, 0.45, 0.70), painter.mesh(front, 800))
    show(figure, (0.52, 0.17, 0.45, 0.70), painter.mesh(back, 800), "the other side")
    _draw_histogram(
        figure.add_axes((0.3, 0.075, 0.38, 0.07)), thickness.clip(low, high), atlas.areas
    )
    save_plot(figure, path)


def _draw_histogram(axes: Axes, thickness: NDArray[np.float64], areas: NDArray[np.float64]) -> None:
    """Share of the surface over thickness, in the colours of the images, as their legend."""
    bins = np.linspace(thickness.min(), thickness.max(), _BARS + 1)
    share, _ = np.histogram(thickness, bins, weights=areas)
    colors = _THICKNESS_COLORS((bins[:-1] - bins[0]) / (bins[-1] - bins[0]))
    axes.bar(
        bins[:-1] * _MILLIMETRES,
        share / share.max(),
        np.diff(bins) * _MILLIMETRES,
        align="edge",
        color=colors,
        edgecolor="none",
    )
    axes.set_yticks([])
    axes.set_xlim(bins[0] * _MILLIMETRES, bins[-1] * _MILLIMETRES)
    axes.spines[["top", "left", "right"]].set_visible(False)
    axes.set_xlabel("thickness [mm]; height: share of the surface", fontsize=11.5)
