"""Figures of an atlas: the mesh with its texel grid, charts, stretch and quality.

Another figure shows the thickness of a layer in place of the stretch.

Every pixel of an image is traced to its place on the charts, so the grid is exactly the atlas's.
"""

from __future__ import annotations

import colorsys
import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure  # without pyplot, which would look for a display
from numpy.typing import NDArray

from ripple_sim.encode.replace import MARK, made_here
from ripple_sim.render.visuals.corners import bake, corner_normals
from ripple_sim.solver import Atlas, AtlasError, TexelTopology, sphere_atlas
from ripple_sim.solver.files import atomic_write, final_path
from ripple_sim.solver.layouts.cube.convention import cube_chart_points
from ripple_sim.solver.mesh.queries import RayScene

# samples along each side of a pixel
OVERSAMPLING = 2

# Direction to the light: to the right, up, to the eye.
_LIGHT = np.array([-0.45, 0.55, 0.7]) / np.linalg.norm([-0.45, 0.55, 0.7])

# cells of the grid along the side of a square with the area of all charts
_GRID_CELLS = 39

_INK = np.array([0.10, 0.13, 0.20])

# The belt of four charts from left to right, the second in the middle of the cross, and those above
# and below it.
BELT = (1, 3, 0, 2)
ABOVE = 4
BELOW = 5

# Gap between the squares of charts, over their side.
_SQUARE_GAP = 0.12

_ENDINGS = (".png", ".jpg", ".pdf", ".svg")
_DPI = 120

# Texels finer than in an even spread are blue, coarser ones are red. The ends are a factor of 2.
STRETCH_COLORS = LinearSegmentedColormap.from_list(
    "stretch", ["#1f4e8c", "#3f8fc0", "#8fd0d4", "#f6f1df", "#f4b46f", "#dd6247", "#8c1d40"], N=512
)
STRETCH_RANGE = 2.0
_HUES = 12

# A thin layer is dark, like bone near the skin in a scan.
_THICKNESS_COLORS = colormaps["viridis"]

# quantiles of the thickness, by area, at the ends of the colours
_SHOWN_QUANTILES = (0.005, 0.97)


@dataclasses.dataclass(frozen=True)
class View:
    """An orthographic look at a surface.

    Attributes
    ----------
    azimuth, elevation : float
        Where the eye is [degrees]; azimuth 0 looks along the negative forward axis, which points
        out of the screen.
    up : str
        Axis of the mesh's file that points up: "y" or "z".
    """

    azimuth: float = 35.0
    elevation: float = 18.0
    up: str = "y"

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors to the right, up and towards the eye, as rows, shape [3, 3]."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        eye = np.array(
            [
                np.sin(azimuth) * np.cos(elevation),
                np.sin(elevation),
                np.cos(azimuth) * np.cos(elevation),
            ]
        )
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        axes = np.stack([right, np.cross(eye, right), eye])
        return axes if self.up == "y" else axes[:, [0, 2, 1]] * [1.0, -1.0, 1.0]


def lit(
    colors: NDArray[np.float64],
    normals: NDArray[np.float64],
    openness: NDArray[np.float64],
    view: View,
) -> NDArray[np.float64]:
    """Shade colours under a soft light from the upper left, with a little sheen.

    The shading is weak, so that the colours can be read.
    """
    local = normals @ view.axes.T
    local /= np.maximum(np.linalg.norm(local, axis=1, keepdims=True), 1e-9)
    diffuse = 0.5 + 0.5 * local @ _LIGHT
    half = _LIGHT + np.array([0.0, 0.0, 1.0])
    sheen = np.maximum(local @ (half / np.linalg.norm(half)), 0) ** 40
    shade = (0.42 + 0.68 * diffuse) * (0.45 + 0.55 * openness)
    return np.clip(colors * shade[:, None] + 0.10 * (sheen * openness)[:, None], 0, 1)


def screen(size: int, half_width: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places x and y of the pixels of a square from -half_width to half_width, row 0 at the top."""
    place = ((np.arange(size) + 0.5) / size * 2 - 1) * half_width
    y, x = np.meshgrid(place[::-1], place, indexing="ij")
    return x, y


def antialiased(
    shape: tuple[int, ...], seen: NDArray[np.int64], colors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """RGBA image, averaged over the oversampling, of colours [k, 3] at the pixels `seen`."""
    fine = np.zeros((shape[0] * shape[1], 4))
    fine[seen, :3] = colors
    fine[seen, 3] = 1.0
    k = OVERSAMPLING
    coarse = fine.reshape(shape[0] // k, k, shape[1] // k, k, 4).mean(axis=(1, 3))
    # colours are summed where something is seen only: undo the dilution, which alpha already
    # expresses
    coarse[..., :3] /= np.maximum(coarse[..., 3:], 1e-9)
    return np.clip(coarse, 0, 1)


class AtlasPainter:
    """Paints images of one atlas.

    Parameters
    ----------
    atlas : Atlas
    colors : [C, n, n, 3]
        Colour of every texel, 0 to 1.
    with_grid : bool
        Whether the texel grid is drawn on the mesh.
    """

    def __init__(
        self, atlas: Atlas, colors: NDArray[np.float64], *, with_grid: bool = True
    ) -> None:
        self._atlas = atlas
        self._colors = colors
        self._with_grid = with_grid
        V = atlas.mesh.V
        F = atlas.mesh.F
        middle = (V.min(axis=0) + V.max(axis=0)) / 2
        self._vertices = (V - middle) / np.linalg.norm(V - middle, axis=1).max()
        self._scene = RayScene(self._vertices, F)
        self._corner_normals = corner_normals(self._vertices, F)
        self._baked = bake(self._vertices, F, atlas.mesh.vertex_normals)

    def mesh(self, view: View, size: int) -> NDArray[np.float64]:
        """RGBA image of the mesh, [size, size, 4], row 0 at the top."""
        right, up, eye = view.axes
        plane = self._vertices @ np.stack([right, up], axis=1)
        middle = (plane.min(axis=0) + plane.max(axis=0)) / 2
        x, y = screen(size * OVERSAMPLING, float(np.ptp(plane, axis=0).max()) / 2 * 1.02)
        origins = (middle[0] + x)[..., None] * right + (middle[1] + y)[..., None] * up + 4 * eye
        triangle, _, *inside = self._scene.cast(origins.reshape(-1, 3), np.tile(-eye, (x.size, 1)))
        seen = np.flatnonzero(triangle >= 0)
        triangle = triangle[seen]
        (u, v) = (each[seen].astype(np.float64) for each in inside)
        weights = np.stack([1 - u - v, u, v], axis=1)
        mesh = self._atlas.mesh
        corners = mesh.F[triangle]
        points = np.einsum("ki,kij->kj", weights, mesh.V[corners])
        normals = np.einsum("ki,kij->kj", weights, self._corner_normals[triangle])
        # an open surface shows its inner side too
        flat = np.cross(
            *np.moveaxis(self._vertices[corners[:, 1:]] - self._vertices[corners[:, :1]], 1, 0)
        )
        inner = flat @ eye < 0
        baked = np.where(inner[:, None], self._baked[corners, 2], self._baked[corners, 0])
        normals[inner] *= -1
        coordinates = self._atlas.chart_map.coordinates(mesh, triangle, points)
        colors = self.paint(
            *self._atlas.chart_map.chart_points(coordinates, self._atlas.resolution)
        )
        return antialiased(
            x.shape, seen, lit(colors, normals, np.einsum("ki,ki->k", weights, baked), view)
        )

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Colours [k, 3] of places on the charts, each [k]; override it to paint others."""
        return self.grid(chart, row, column, on_surface=True)

    def grid(
        self,
        chart: NDArray[np.int64],
        row: NDArray[np.float64],
        column: NDArray[np.float64],
        *,
        on_surface: bool,
    ) -> NDArray[np.float64]:
        """Colours of points on the charts [k, 3].

        They are the colours of the texels, under a grid of fine lines and the borders of the
        charts.

        The lines are equally wide on the surface, or else in the charts.
        """
        n = self._atlas.resolution
        i, j = (np.clip(np.rint(x).astype(np.int64), 0, n - 1) for x in (row, column))
        colors = self._colors[chart, i, j]
        if not self._with_grid:
            return colors
        cells = min(max(1, round(_GRID_CELLS / len(self._colors) ** 0.5)), n)
        along = np.stack([row, column]) + 0.5
        scale = cells / n * (self._widths[:, chart, i, j] if on_surface else 1.0)
        to_line = (np.abs((along * (cells / n) + 0.5) % 1 - 0.5) * (n / cells) * scale).min(axis=0)
        to_edge = (np.minimum(along, n - along) * scale).min(axis=0)
        ink = np.where(to_edge < 0.09, 0.85, np.where(to_line < 0.04, 0.42, 0.0))[:, None]
        return colors * (1 - ink) + _INK * ink

    @functools.cached_property
    def _widths(self) -> NDArray[np.float64]:
        """Width of rows and columns on the surface, relative to an even spread, [2, C, n, n]."""
        with_halo = self._atlas.texels.halo_positions
        areas = self._atlas.areas
        own = with_halo[:, 1:-1, 1:-1]
        even = np.sqrt(areas.mean())

        def width(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
            sides = np.stack([np.linalg.norm(each - own, axis=-1) for each in (before, after)])
            side = np.where(np.isfinite(sides), sides, 0.0).sum(axis=0) / np.isfinite(sides).sum(
                axis=0
            ).clip(1)
            return areas / np.maximum(side, 1e-6 * even)

        rows = width(with_halo[:, 1:-1, :-2], with_halo[:, 1:-1, 2:])
        columns = width(with_halo[:, :-2, 1:-1], with_halo[:, 2:, 1:-1])
        return np.stack([rows, columns]) / even


def sphere_image(
    painter: AtlasPainter, resolution: int, view: View, size: int
) -> NDArray[np.float64]:
    """RGBA image [size, size, 4] of the unit sphere that the cube layout maps a mesh onto."""
    x, y = screen(size * OVERSAMPLING, 1.01)
    seen = np.flatnonzero((x**2 + y**2).ravel() < 1)
    local = np.stack([x.ravel()[seen], y.ravel()[seen]], axis=1)
    local = np.column_stack([local, np.sqrt(1 - (local**2).sum(axis=1))])
    directions = local @ view.axes
    colors = painter.grid(*cube_chart_points(directions, resolution), on_surface=False)
    return antialiased(x.shape, seen, lit(colors, directions, np.ones(len(seen)), view))


def cross(painter: AtlasPainter, resolution: int, size: int) -> NDArray[np.float64]:
    """RGBA image [3 size, 4 size, 4] of a cube's six charts, unfolded.

    Four charts are in the middle row, with one above and one below.
    """
    image = np.zeros((3 * size, 4 * size, 4))
    for chart, i, k in [(chart, 1, k) for k, chart in enumerate(BELT)] + [
        (ABOVE, 0, 1),
        (BELOW, 2, 1),
    ]:
        image[i * size : (i + 1) * size, k * size : (k + 1) * size] = _square(
            painter, chart, resolution, size
        )
    return image


def squares(
    painter: AtlasPainter, shape: tuple[int, int, int], width: int, height: int
) -> NDArray[np.float64]:
    """RGBA image, at most [height, width, 4], of all charts side by side from the upper left."""
    count, n, _ = shape
    columns = max(range(1, count + 1), key=lambda k: min(width / k, height / -(-count // k)))
    rows = -(-count // columns)
    pitch = max(int(min(width / columns, height / rows)), 2)
    size = max(round(pitch * (1 - _SQUARE_GAP)), 1)
    image = np.zeros((rows * pitch, columns * pitch, 4))
    for chart in range(count):
        i, k = divmod(chart, columns)
        image[i * pitch : i * pitch + size, k * pitch : k * pitch + size] = _square(
            painter, chart, n, size
        )
    return image


def _square(painter: AtlasPainter, chart: int, resolution: int, size: int) -> NDArray[np.float64]:
    fine = size * OVERSAMPLING
    place = (np.arange(fine) + 0.5) / fine * resolution - 0.5
    row, column = np.meshgrid(place[::-1], place, indexing="ij")
    colors = painter.grid(np.full(row.size, chart), row.ravel(), column.ravel(), on_surface=False)
    return antialiased(row.shape, np.arange(row.size), colors)


TEXT, FAINT = "#1b2432", "#6b7685"


def check_plot_path(path: str | Path, overwrite: bool = True) -> None:
    """Check that a figure can be written.

    Raises `AtlasError` if the ending is unknown, the folder is missing, or another file is in the
    way.
    """
    path = Path(path)
    if path.suffix.lower() not in _ENDINGS:
        raise AtlasError(
            f"plot file {str(path)!r} has an unknown ending: it must end in {', '.join(_ENDINGS)}"
        )
    if not path.absolute().parent.is_dir() or path.is_dir():
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: name a file in a folder that exists"
        )
    try:
        final = final_path(path)
    except OSError as error:
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: {error.strerror}; name another file"
        ) from error
    if final.exists() and not (overwrite or made_here(final)):
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: it exists and was not {MARK}; name "
            "another file, or add --overwrite"
        )


def dressed(title: str, subtitle: str) -> Figure:
    """An empty figure with a title."""
    figure = Figure(figsize=(16, 9), dpi=_DPI, facecolor="white")
    figure.text(0.03, 0.945, title, fontsize=25, fontweight="bold", color=TEXT, va="center")
    figure.text(0.03, 0.903, subtitle, fontsize=12.5, color=FAINT, va="center")
    return figure


def show(
    figure: Figure, place: tuple[float, float, float, float], image: NDArray, caption: str = ""
) -> None:
    """Put an image at a place of a figure, left, bottom, width, height in shares of it."""
    axes = figure.add_axes(place)
    axes.imshow(image, interpolation="antialiased")
    axes.set_axis_off()
    if caption:
        axes.text(
            0.5,
            -0.03,
            caption,
            transform=axes.transAxes,
            ha="center",
            va="top",
            fontsize=11.5,
            color=FAINT,
        )


def save_plot(figure: Figure, path: str | Path) -> None:
    """Write a figure, marked as made here, whole or not at all.

    Raises `AtlasError` if that fails.
    """
    ending = Path(path).suffix.lower()
    told: dict[str, Any] = {"Software" if ending == ".png" else "Creator": MARK}
    mark: dict[str, Any] = {"metadata": told | ({"Date": None} if ending == ".svg" else {})}
    if ending == ".jpg":
        mark = {"pil_kwargs": {"comment": MARK.encode()}}
    try:
        with atomic_write(Path(path)) as unfinished:
            figure.savefig(unfinished, format=ending[1:], dpi=_DPI, **mark)
    except OSError as error:
        raise AtlasError(
            f"plot file {str(path)!r} cannot be written: {error.strerror or error}"
        ) from error


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
        near = hues[np.isin(topology.corners, corners).any(axis=1)]
        # steps of 5 hues of 12 visit all of them, far from each other
        free = (hue for hue in (5 * (chart + k) % _HUES for k in range(_HUES)) if hue not in near)
        hues[chart] = next(free, chart % _HUES)
    return np.array(
        [colorsys.hls_to_rgb(hue / _HUES, 0.74 - 0.08 * (hue % 2), 0.62) for hue in hues.tolist()]
    )


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
