"""`plot_thickness`: a figure of the thickness of a layer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .atlas_painter import AtlasPainter, View
from .figure_file import check_plot_path, dressed, save_plot, show

# A thin layer is dark, like bone near the skin in a scan.
_THICKNESS_COLORS = colormaps["viridis"]

# quantiles of the thickness, by area, at the ends of the colours
_SHOWN_QUANTILES = (0.005, 0.97)


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

    Otherwise it is like `plot_atlas`.
    """
    check_plot_path(path)
    low, high = np.quantile(thickness, _SHOWN_QUANTILES)
    shade = np.clip((thickness - low) / max(high - low, 1e-9 * high), 0, 1)
    painter = AtlasPainter(atlas, _THICKNESS_COLORS(shade)[..., :3], with_grid=False)
    figure = dressed(title, subtitle)
    show(figure, (0.03, 0.17, 0.45, 0.70), painter.mesh(View(up=up), 800))
    show(
        figure,
        (0.52, 0.17, 0.45, 0.70),
        painter.mesh(View(azimuth=View.azimuth + 180, up=up), 800),
        "the other side",
    )
    # share of the surface over thickness, in the colours of the images, as their legend
    axes = figure.add_axes((0.3, 0.075, 0.38, 0.07))
    bins = np.linspace(low, high, 101)
    share, _ = np.histogram(thickness.clip(low, high), bins, weights=atlas.areas)
    colors = _THICKNESS_COLORS((bins[:-1] - bins[0]) / (bins[-1] - bins[0]))
    axes.bar(
        bins[:-1] * 1e3,
        share / share.max(),
        np.diff(bins) * 1e3,
        align="edge",
        color=colors,
        edgecolor="none",
    )
    axes.set_yticks([])
    axes.set_xlim(low * 1e3, high * 1e3)
    axes.spines[["top", "left", "right"]].set_visible(False)
    axes.set_xlabel("thickness [mm]; height: share of the surface", fontsize=11.5)
    save_plot(figure, path)
