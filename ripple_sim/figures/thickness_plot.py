"""A figure of a layer's thickness: the mesh from both sides, and how much of it has which thickness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .atlas_view import AtlasPainter
from .plot_page import check_plot_path, dressed, save_plot, show
from .view import View

# Thin is dark, as bone near the skin is in a scan that is looked through.
_COLORS = colormaps["viridis"]
_SHOWN = (0.005, 0.97)  # shares of the area between which the colours run


def plot_thickness(
    atlas: Atlas, thickness: NDArray[np.float64], path: str | Path, *, title: str, subtitle: str = "", up: str = "y"
) -> None:
    """Write a figure of the thickness [m] of a layer, [C, n, n], see `thickness_map`.

    Parameters
    ----------
    atlas : Atlas
    thickness : [C, n, n]
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
    low, high = np.quantile(thickness, _SHOWN)
    shade = np.clip((thickness - low) / max(high - low, 1e-9 * high), 0, 1)
    painter = _Painter(atlas, _COLORS(shade)[..., :3])
    figure = dressed(title, subtitle)
    show(figure, (0.03, 0.17, 0.45, 0.70), painter.mesh(View(up=up), 800))
    show(figure, (0.52, 0.17, 0.45, 0.70), painter.mesh(View(azimuth=View.azimuth + 180, up=up), 800), "the other side")
    _histogram(figure.add_axes((0.3, 0.075, 0.38, 0.07)), thickness, atlas.areas, (low, high))
    save_plot(figure, path)


class _Painter(AtlasPainter):
    """Leaves out the texel grid."""

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        last = self._atlas.resolution - 1
        i, j = (np.clip(np.rint(x).astype(np.int64), 0, last) for x in (row, column))
        return self._colors[chart, i, j]


def _histogram(
    axes: Axes, thickness: NDArray[np.float64], areas: NDArray[np.float64], ends: tuple[float, float]
) -> None:
    """Share of the surface over thickness, in the colours of the images, as their legend."""
    bins = np.linspace(*ends, 101)
    share, _ = np.histogram(thickness.clip(*ends), bins, weights=areas)
    colors = _COLORS((bins[:-1] - bins[0]) / (bins[-1] - bins[0]))
    axes.bar(bins[:-1] * 1e3, share / share.max(), np.diff(bins) * 1e3, align="edge", color=colors, edgecolor="none")
    axes.set_yticks([])
    axes.set_xlim(ends[0] * 1e3, ends[1] * 1e3)
    axes.spines[["top", "left", "right"]].set_visible(False)
    axes.set_xlabel("thickness [mm]; height: share of the surface", fontsize=11.5)
