"""`plot_atlas`: a figure of an atlas, with its mesh, charts, stretch and quality."""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import Any

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

# Places of the images: left, bottom, width and height, as shares of the figure.
_FRONT_PLACE = (0.025, 0.05, 0.37, 0.82)
_BACK_PLACE = (0.42, 0.50, 0.20, 0.38)
_SMALL_PLACE = (0.42, 0.07, 0.20, 0.355)
_CHARTS_PLACE = (0.635, 0.455, 0.35, 0.47)
_HISTOGRAM_PLACE = (0.655, 0.300, 0.31, 0.105)

# Places of the numbers: left of the two columns, and the height of the first row, of the name under
# a number and from row to row, as shares of the figure.
_QUALITY_COLUMNS = (0.655, 0.83)
_QUALITY_ROWS = 3
_QUALITY_TOP = 0.196
_NAME_TOP = 0.170
_QUALITY_PITCH = 0.062


def texel_stretch(atlas: Atlas) -> NDArray[np.float64]:
    """Stretch at every texel, [C, n, n]: sqrt(share of the area over even share).

    In the cube layout the even share of a texel is its share of the sphere. In other layouts it is
    the same for all texels.
    """
    if atlas.layout == "cube":
        even_areas = sphere_atlas(1.0, atlas.resolution).areas
    else:
        even_areas = np.ones_like(atlas.areas)
    area_share = atlas.areas / atlas.areas.sum()
    even_share = even_areas / even_areas.sum()
    return np.sqrt(area_share / even_share)


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
        mesh_painter = painter
        small_image = sphere_image(painter, atlas.resolution, front, 380)
        small_caption = "on the sphere"
        charts_image = cross(painter, atlas.resolution, 160)
        charts_caption = "the six charts, unfolded"
    else:
        color_by_chart = chart_colors(atlas.texels.topology)
        colors = np.broadcast_to(color_by_chart[:, None, None], (*atlas.texels.shape, 3))
        mesh_painter = AtlasPainter(atlas, colors)
        small_image = painter.mesh(front, 380)
        small_caption = "stretch"
        charts_image = squares(painter, atlas.texels.shape, 672, 508)
        charts_caption = f"the {len(colors)} charts, side by side"
    show(figure, _FRONT_PLACE, mesh_painter.mesh(front, 800))
    show(figure, _BACK_PLACE, mesh_painter.mesh(back, 400), "the other side")
    show(figure, _SMALL_PLACE, small_image, small_caption)
    show(figure, _CHARTS_PLACE, charts_image, charts_caption)
    _draw_histogram(figure.add_axes(_HISTOGRAM_PLACE), stretch, atlas.areas)
    _write_quality(figure, atlas)
    save_plot(figure, path)


def _draw_histogram(axes: Axes, stretch: NDArray[np.float64], areas: NDArray[np.float64]) -> None:
    """Share of the surface over stretch, in the colours of the images: it is their legend too."""
    bins = np.geomspace(1 / STRETCH_RANGE, STRETCH_RANGE, 121)
    area_in_bin, _ = np.histogram(stretch.clip(bins[0], bins[-1]), bins, weights=areas)
    heights = area_in_bin / area_in_bin.max()
    middles = np.sqrt(bins[1:] * bins[:-1])
    bars: dict[str, Any] = {
        "width": np.diff(bins),
        "align": "edge",
        "color": STRETCH_COLORS(stretch_shade(middles)),
        "edgecolor": "none",
    }
    axes.bar(bins[:-1], heights, **bars)
    axes.stairs(heights, bins, color=FAINT, linewidth=0.7)  # pale bars need an outline
    axes.bar(bins[:-1], -0.14, bottom=-0.03, **bars)  # the strip of colours below
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


def _write_quality(figure: Figure, atlas: Atlas) -> None:
    """Write the numbers of `Atlas.quality`; a number that the layout does not know is a dash."""
    even_edge = np.sqrt(atlas.mesh.area / atlas.areas.size)  # [m]
    # how to write a number from the entries of the quality, times a factor
    entries = {
        "folded triangles": ("{flipped}", 1.0),
        "area starved (stretch over 4)": ("{starved:.2f} %", 100.0),
        "texel area / mesh area": ("{coverage:.4f}", 1.0),
        "stretch, median": ("{q50:.2f}", 1.0),
        "stretch, 0.1 % to 99.9 %": ("{q001:.2f} to {q999:.2f}", 1.0),
        "texel edges / even grid": ("{edge_min:.2f} to {edge_max:.2f}", 1 / even_edge),
    }
    quality = atlas.quality()
    for index, (name, (form, factor)) in enumerate(entries.items()):
        values = quality
        if factor != 1.0:
            values = {key: value * factor for key, value in quality.items()}
        try:
            text = form.format(**values)
        except KeyError:
            text = "-"
        column, row = divmod(index, _QUALITY_ROWS)
        left = _QUALITY_COLUMNS[column]
        top = _QUALITY_TOP - _QUALITY_PITCH * row
        figure.text(left, top, text, fontsize=16, fontweight="bold", color=TEXT, va="center")
        name_top = _NAME_TOP - _QUALITY_PITCH * row
        figure.text(left, name_top, name, fontsize=11, color=FAINT, va="center")
