"""Figures of an atlas: the mesh with the texel grid, charts, stretch and quality; or the thickness of its layer."""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure  # without pyplot, which would look for a display
from numpy.typing import NDArray

from ripple_sim.encode.replace import MARK, made_here
from ripple_sim.solver import Atlas, AtlasError, TexelTopology, sphere_atlas
from ripple_sim.solver.files import final_path

from .atlas_view import AtlasPainter, View, cross, sphere_image, squares

TEXT, FAINT = "#1b2432", "#6b7685"

_ENDINGS = (".png", ".jpg", ".pdf", ".svg")
_DPI = 120


def check_plot_path(path: str | Path, overwrite: bool = True) -> None:
    """Raise `AtlasError` if the ending is unknown, the folder missing, or the file another's that must not go."""
    path = Path(path)
    if path.suffix.lower() not in _ENDINGS:
        raise AtlasError(f"plot file {str(path)!r} has an unknown ending; valid are {', '.join(_ENDINGS)}")
    if not path.absolute().parent.is_dir() or path.is_dir():
        raise AtlasError(f"plot file {str(path)!r} cannot be written: name a file in a folder that exists")
    try:
        final = final_path(path)
    except OSError as error:
        raise AtlasError(f"plot file {str(path)!r} cannot be written: {error.strerror}; name another file") from error
    if final.exists() and not (overwrite or made_here(final)):
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: it exists and was not {MARK}; name another file, or add "
            "--overwrite"
        )


def dressed(title: str, subtitle: str) -> Figure:
    """An empty figure with a title."""
    figure = Figure(figsize=(16, 9), dpi=_DPI, facecolor="white")
    figure.text(0.03, 0.945, title, fontsize=25, fontweight="bold", color=TEXT, va="center")
    figure.text(0.03, 0.903, subtitle, fontsize=12.5, color=FAINT, va="center")
    return figure


def show(figure: Figure, place: tuple[float, float, float, float], image: NDArray, caption: str = "") -> None:
    """Put an image at a place of a figure, left, bottom, width, height in shares of it."""
    axes = figure.add_axes(place)
    axes.imshow(image, interpolation="antialiased")
    axes.set_axis_off()
    if caption:
        axes.text(0.5, -0.03, caption, transform=axes.transAxes, ha="center", va="top", fontsize=11.5, color=FAINT)


def save_plot(figure: Figure, path: str | Path) -> None:
    """Write a figure with the mark of files that were made here.

    Raises
    ------
    AtlasError
        If that fails.
    """
    try:
        figure.savefig(path, dpi=_DPI, **_marked(Path(path).suffix.lower()))
    except OSError as error:
        raise AtlasError(f"plot file {str(path)!r} cannot be written: {error.strerror or error}") from error


def _marked(ending: str) -> dict[str, Any]:
    """How each format is told to hold the mark of files that were made here."""
    if ending == ".jpg":
        return {"pil_kwargs": {"comment": MARK.encode()}}
    name = "Software" if ending == ".png" else "Creator"
    return {"metadata": {name: MARK, **({"Date": None} if ending == ".svg" else {})}}


# Finer than an even spread is blue, coarser is red; the ends stand for a factor of 2.
STRETCH_COLORS = LinearSegmentedColormap.from_list(
    "stretch", ["#1f4e8c", "#3f8fc0", "#8fd0d4", "#f6f1df", "#f4b46f", "#dd6247", "#8c1d40"], N=512
)
STRETCH_RANGE = 2.0
_HUES = 12


def texel_stretch(atlas: Atlas) -> NDArray[np.float64]:
    """Stretch at every texel, [C, n, n]: sqrt(real area over even share).

    In the cube layout the even share is that of the texel on the sphere, in others the same for all texels.
    """
    share = sphere_atlas(1.0, atlas.resolution).areas if atlas.layout == "cube" else np.ones_like(atlas.areas)
    return np.sqrt((atlas.areas / atlas.areas.sum()) / (share / share.sum()))


def stretch_shade(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place on the colour scale, 0 to 1."""
    return np.clip(0.5 + 0.5 * np.log(stretch) / np.log(STRETCH_RANGE), 0, 1)


def stretch_colors(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours [..., 3] of stretches."""
    return STRETCH_COLORS(stretch_shade(stretch))[..., :3]


def chart_colors(topology: TexelTopology) -> NDArray[np.float64]:
    """A pale colour for each chart, [C, 3], never that of a chart beside it."""
    hues = np.full(len(topology.glued), -1)
    meeting: list[set[int]] = [set() for _ in range(int(topology.corners.max()) + 1)]
    for chart, corners in enumerate(topology.corners.tolist()):
        for corner in corners:
            meeting[corner].add(chart)
    for chart, corners in enumerate(topology.corners.tolist()):
        near = {int(hues[other]) for corner in corners for other in meeting[corner]}
        # steps of 5 hues of 12 visit all of them, far from each other
        free = [hue for hue in (5 * (chart + k) % _HUES for k in range(_HUES)) if hue not in near]
        hues[chart] = free[0] if free else chart % _HUES
    return np.array([colorsys.hls_to_rgb(hue / _HUES, 0.74 - 0.08 * (hue % 2), 0.62) for hue in hues.tolist()])


def plot_atlas(atlas: Atlas, path: str | Path, *, title: str, subtitle: str = "", up: str = "y") -> None:
    """Write a figure of an atlas and its quality.

    Parameters
    ----------
    atlas : Atlas
    path : path
        Ends in .png, .jpg, .pdf or .svg.
    title : str
        Of the figure.
    subtitle : str
        Line below the title.
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
    title : str
        Of the figure.
    subtitle : str
        Line below the title.
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
    _thickness_histogram(figure.add_axes((0.3, 0.075, 0.38, 0.07)), thickness, atlas.areas, (low, high))
    save_plot(figure, path)


class _Painter(AtlasPainter):
    """Leaves out the texel grid."""

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        last = self._atlas.resolution - 1
        i, j = (np.clip(np.rint(x).astype(np.int64), 0, last) for x in (row, column))
        return self._colors[chart, i, j]


def _thickness_histogram(
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
