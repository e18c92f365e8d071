"""A sheet with a picture of each mode of a surface, deflected, red outwards, blue inwards."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure  # without pyplot, which would look for a display
from numpy.typing import NDArray

from ripple_sim.render.visuals.corners import corner_normals
from ripple_sim.solver import Atlas, Modes, texel_atlas
from ripple_sim.solver.mesh.queries import RayScene
from ripple_sim.solver.texels.halo import sampling_matrix

from .atlas_painter import AtlasPainter, View
from .atlas_plot import STRETCH_COLORS
from .figure_file import TEXT, check_plot_path, dressed, save_plot, show

# Greatest height of a mode over the radius of a sheet.
_MAX_SHEET_HEIGHT = 0.3

# Greatest height of a mode over the radius of a body, which must not pass through itself.
_MAX_BODY_HEIGHT = 0.05

# Greatest height of a mode over its wavelength.
_MAX_WAVE_HEIGHT = 0.12

# Greatest thickness of a sheet over its size.
_MAX_SHEET_THICKNESS = 0.2

# Elevation of the eye above a sheet [degrees]: sheets are shown from higher up than bodies.
_SHEET_ELEVATION = 32.0

# Place of all pictures: left, bottom, width and height, as shares of the figure.
_PLACE = (0.03, 0.02, 0.94, 0.85)

# Share of the width that the pictures fill.
_FILLED_WIDTH = 0.92

# Height of a caption [pixels].
_CAPTION_HEIGHT = 54

# Size of a picture, at most [pixels].
_MAX_PICTURE_SIZE = 640

# Side of a picture as it is drawn over the side of a square with its share of the place: margins
# are cut off later.
_PICTURE_SIZE = 1.2

# Significant digits of a frequency.
_FREQUENCY_DIGITS = 4


class ModePainter(AtlasPainter):
    """Draws the shapes of modes on the surface that the texels span.

    That surface is fine enough to show the bending.
    """

    def __init__(self, atlas: Atlas) -> None:
        fine = texel_atlas(atlas.texels)
        super().__init__(fine, np.ones((*atlas.areas.shape, 3)), with_grid=False)
        self._vertices_at_rest = self._vertices  # in units of the radius
        self._normals = fine.mesh.vertex_normals
        self._at_vertices = fine.sampling_matrix(fine.mesh.V)  # from texels to vertices
        self._stiffness = atlas.stiffness()
        size = np.linalg.norm(np.ptp(fine.mesh.V, axis=0))
        size_in_radii = np.linalg.norm(np.ptp(self._vertices_at_rest, axis=0))
        self._radius = size / size_in_radii  # [m]
        self._max_height = _MAX_SHEET_HEIGHT if _is_sheet(atlas) else _MAX_BODY_HEIGHT
        self._shape = np.zeros(atlas.areas.size)

    def mode(self, shape: NDArray[np.float64], view: View, size: int) -> NDArray[np.float64]:
        """RGBA image [size, size, 4] of the shape of a mode, [C, n, n] between -1 and 1."""
        self._shape = shape.ravel()
        height = self._height() * (self._at_vertices @ self._shape)
        self._vertices = self._vertices_at_rest + height[:, None] * self._normals
        F = self._atlas.mesh.F
        self._scene = RayScene(self._vertices, F)
        self._corner_normals = corner_normals(self._vertices, F)
        return self.mesh(view, size)

    def _height(self) -> float:
        """Greatest height of the mode that is drawn, in units of the radius."""
        shape = self._shape
        areas = self._atlas.areas.ravel()
        # Rayleigh's quotient of the Laplacian: 0 for a mode that is the same everywhere
        squared = shape @ (self._stiffness @ shape) / (shape @ (areas * shape))
        wave_number = np.sqrt(max(squared, 0.0))
        wavelength = 2 * np.pi / max(wave_number * self._radius, 1e-9)
        return min(self._max_height, _MAX_WAVE_HEIGHT * wavelength)

    def paint(
        self, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Colours [k, 3] of the shape at places on the charts, each [k]."""
        value = sampling_matrix(self._atlas.texels.topology, chart, row, column) @ self._shape
        return STRETCH_COLORS(0.5 + 0.5 * value)[:, :3]


def plot_modes(
    atlas: Atlas, found: Modes, path: str | Path, *, title: str, subtitle: str = "", up: str = "y"
) -> None:
    """Write a figure with a picture of each mode, its frequency and its decay time.

    Parameters
    ----------
    atlas : Atlas
    found : Modes
        Of that atlas.
    path : path
        Ends in .png, .jpg, .pdf or .svg.
    up : str
        Axis of the mesh that points up, "y" or "z"; a flat sheet in the plane of the other two lies
        down in any case.

    Raises
    ------
    AtlasError
        If the ending is unknown or the file cannot be written.
    """
    check_plot_path(path)
    figure = dressed(title, subtitle)
    images = _mode_images(
        atlas, found, _view(atlas, up), _max_image_size(figure, len(found.shapes))
    )
    places = _image_places(figure, images.shape[1] / images.shape[2], len(images))
    for k, (image, place) in enumerate(zip(images, places, strict=True)):
        show(figure, place, image)
        left, bottom, width, _ = place
        figure.text(
            left + width / 2,
            bottom - _CAPTION_HEIGHT / 3 / (figure.get_figheight() * figure.dpi),
            f"{k + 1}:  {_frequency_text(found.frequencies[k])}",
            fontsize=12,
            color=TEXT,
            ha="center",
            va="center",
        )
    save_plot(figure, path)


def _view(atlas: Atlas, up: str) -> View:
    """The view of all modes: a sheet lies down."""
    thin_axis = "xyz"[np.ptp(atlas.mesh.V, axis=0).argmin()]
    if _is_sheet(atlas) and thin_axis != "x":
        return View(up=thin_axis, elevation=_SHEET_ELEVATION)
    return View(up=up)


def _max_image_size(figure: Figure, count: int) -> int:
    """Size at which to draw each of `count` pictures [pixels]."""
    area = _place_width(figure) * _place_height(figure)
    return round(min(_MAX_PICTURE_SIZE, _PICTURE_SIZE * np.sqrt(area / count)))


def _place_width(figure: Figure) -> float:
    """Width of the place of all pictures [pixels]."""
    return _PLACE[2] * figure.get_figwidth() * figure.dpi


def _place_height(figure: Figure) -> float:
    """Height of the place of all pictures [pixels]."""
    return _PLACE[3] * figure.get_figheight() * figure.dpi


def _mode_images(atlas: Atlas, found: Modes, view: View, size: int) -> NDArray[np.float64]:
    """RGBA images of all modes, [k, height, width, 4], without the margin that all have."""
    painter = ModePainter(atlas)
    images = np.stack([painter.mode(shape, view, size) for shape in found.shapes])
    is_seen = images[..., 3].max(axis=0)
    rows = np.flatnonzero(is_seen.max(axis=1))
    columns = np.flatnonzero(is_seen.max(axis=0))
    return images[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def _image_places(
    figure: Figure, aspect: float, count: int
) -> list[tuple[float, float, float, float]]:
    """Left, bottom, width and height of `count` pictures, as shares of the figure.

    `aspect` is the height of a picture over its width.
    """
    place_width = _place_width(figure)
    place_height = _place_height(figure)

    def picture_width(columns: int) -> float:
        """Width of a picture [pixels], if there are so many side by side."""
        rows = math.ceil(count / columns)
        room_across = _FILLED_WIDTH * place_width / columns
        room_down = place_height / rows - _CAPTION_HEIGHT
        return min(room_across, room_down / aspect)

    columns = max(range(1, count + 1), key=picture_width)
    rows = math.ceil(count / columns)
    left, bottom, all_width, all_height = _PLACE
    figure_width = figure.get_figwidth() * figure.dpi
    figure_height = figure.get_figheight() * figure.dpi
    width = picture_width(columns) / figure_width
    height = aspect * width * figure_width / figure_height
    places = []
    for k in range(count):
        row, column = divmod(k, columns)
        middle = left + (column + 0.5) * all_width / columns
        top = bottom + all_height * (1 - row / rows)
        places.append((middle - width / 2, top - height, width, height))
    return places


def _frequency_text(frequency: float) -> str:
    """A frequency [Hz] with four significant digits, but whole above these."""
    if not frequency:
        return "0 Hz"
    digits_before_point = int(np.floor(np.log10(frequency))) + 1
    decimals = max(0, _FREQUENCY_DIGITS - digits_before_point)
    return f"{frequency:.{decimals}f} Hz"


def _is_sheet(atlas: Atlas) -> bool:
    """Whether the surface is flat, so that its modes may be drawn high."""
    extents = np.ptp(atlas.mesh.V, axis=0)
    return bool(extents.min() < _MAX_SHEET_THICKNESS * extents.max())
