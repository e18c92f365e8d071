"""`plot_atlas`: a figure of an atlas, with its mesh, charts, stretch and quality."""

from __future__ import annotations

import colorsys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure  # without pyplot, which would look for a display
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, TexelTopology, sphere_atlas

from .atlas_painter import AtlasPainter, View, cross, sphere_image, squares
from .figure_file import FAINT, TEXT, check_plot_path, dressed, save_plot, show

# Texels finer than in an even spread are blue, coarser ones are red. The ends are a factor of 2.
STRETCH_COLORS = LinearSegmentedColormap.from_list(
    "stretch", ["#1f4e8c", "#3f8fc0", "#8fd0d4", "#f6f1df", "#f4b46f", "#dd6247", "#8c1d40"], N=512
)
STRETCH_RANGE = 2.0

# Hues of charts. Steps of 5 visit all 12 of them, far from each other; every other hue is darker.
_HUES = 12
_HUE_STEP = 5
_LIGHTNESS = (0.74, 0.66)
_SATURATION = 0.62


def texel_stretch(atlas: Atlas) -> NDArray[np.float64]:
    """Stretch at every texel, [C, n, n]: sqrt(real area over even share).

    In the cube layout the even share is that of the texel on the sphere, in others the same for all
    texels.
    """
    share = (
        sphere_atlas(1.0, atlas.resolution).areas
        if atlas.layout == "cube"
        else np.ones_like(atlas.areas)
    )
    return np.sqrt((atlas.areas / atlas.areas.sum()) / (share / share.sum()))


def stretch_shade(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place on the colour scale, 0 to 1."""
    return np.clip(0.5 + 0.5 * np.log(stretch) / np.log(STRETCH_RANGE), 0, 1)


def chart_colors(topology: TexelTopology) -> NDArray[np.float64]:
    """A pale colour for each chart, [C, 3]; neighbouring charts differ."""
    hues = np.full(len(topology.glued), -1)
    for chart, corners in enumerate(topology.corners):
        taken = hues[np.isin(topology.corners, corners).any(axis=1)]
        hues[chart] = chart % _HUES
        for k in range(_HUES):
            hue = _HUE_STEP * (chart + k) % _HUES
            if hue not in taken:
                hues[chart] = hue
                break
    colors = []
    for hue in hues.tolist():
        lightness = _LIGHTNESS[hue % 2]
        colors.append(colorsys.hls_to_rgb(hue / _HUES, lightness, _SATURATION))
    return np.array(colors)


def plot_atlas(
    atlas: Atlas, path: str | Path, *, title: str, subtitle: str = "", up: str = "y"
) -> None:
    """Write a figure of an atlas and its quality, with a subtitle below its title.

    Parameters
    ----------
    path : path
        Ends in .png, .jpg, .pdf or .svg.
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
    painter = AtlasPainter(atlas, STRETCH_COLORS(stretch_shade(stretch))[..., :3])
    front = View(up=up)
    back = View(azimuth=View.azimuth + 180, up=up)
    if atlas.layout == "cube":
        large = painter
        small = (sphere_image(painter, atlas.resolution, front, 380), "on the sphere")
        page = cross(painter, atlas.resolution, 160), "the six charts, unfolded"
    else:
        colors = np.broadcast_to(
            chart_colors(atlas.texels.topology)[:, None, None], (*atlas.texels.shape, 3)
        )
        large = AtlasPainter(atlas, colors)
        small = (painter.mesh(front, 380), "stretch")
        page = (
            squares(painter, atlas.texels.shape, 672, 508),
            f"the {len(colors)} charts, side by side",
        )
    show(figure, (0.025, 0.05, 0.37, 0.82), large.mesh(front, 800))
    show(figure, (0.42, 0.50, 0.20, 0.38), large.mesh(back, 400), "the other side")
    show(figure, (0.42, 0.07, 0.20, 0.355), *small)
    show(figure, (0.635, 0.455, 0.35, 0.47), *page)
    _histogram(figure.add_axes((0.655, 0.300, 0.31, 0.105)), stretch, atlas.areas)
    _figures(figure, atlas)
    save_plot(figure, path)


def _histogram(axes: Axes, stretch: NDArray[np.float64], areas: NDArray[np.float64]) -> None:
    """Share of the surface over stretch, in the colours of the images, as their legend."""
    bins = np.geomspace(1 / STRETCH_RANGE, STRETCH_RANGE, 121)
    share, _ = np.histogram(stretch.clip(bins[0], bins[-1]), bins, weights=areas)
    colors = STRETCH_COLORS(stretch_shade(np.sqrt(bins[1:] * bins[:-1])))  # those of the middles
    axes.bar(
        bins[:-1], share / share.max(), np.diff(bins), align="edge", color=colors, edgecolor="none"
    )
    axes.stairs(share / share.max(), bins, color=FAINT, linewidth=0.7)  # pale bars need an outline
    axes.bar(
        bins[:-1], -0.14, np.diff(bins), bottom=-0.03, align="edge", color=colors, edgecolor="none"
    )
    axes.set_xscale("log")
    axes.set_xlim(bins[0], bins[-1])
    axes.set_ylim(-0.17, 1.02)
    ticks = [0.5, 0.6, 0.7, 0.8, 1.0, 1.25, 1.5, 2.0]
    axes.set_xticks(
        ticks, ["≤ ½", *(f"{t:g}" for t in ticks[1:-1]), "≥ 2"], fontsize=10, color=TEXT
    )
    axes.set_xticks([], minor=True)
    axes.set_yticks([])
    axes.tick_params(length=0, pad=3)
    axes.set_xlabel("stretch: texel width relative to an even spread", fontsize=11.5, color=FAINT)
    axes.spines[:].set_visible(False)


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
        left = (0.655, 0.83)[index // 3]
        k = index % 3
        values = {key: value if unit == 1.0 else value * unit for key, value in quality.items()}
        try:
            text = form.format(**values)
        except KeyError:  # the layout does not know it
            text = "-"
        figure.text(
            left, 0.196 - 0.062 * k, text, fontsize=16, fontweight="bold", color=TEXT, va="center"
        )
        figure.text(left, 0.170 - 0.062 * k, name, fontsize=11, color=FAINT, va="center")
