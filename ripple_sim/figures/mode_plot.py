"""A sheet with a picture of each mode of a surface, deflected, red outwards, blue inwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
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

# [degrees]: sheets are shown from higher up than bodies
_SHEET_ELEVATION = 32.0

# Place of all pictures: left, bottom, width and height, as shares of the figure.
_PLACE = (0.03, 0.02, 0.94, 0.85)

# Share of the width that the pictures fill.
_FILLED = 0.92

# [pixels]: height of a caption
_CAPTION = 54

# [pixels]: largest picture
_LARGEST = 640


class ModePainter(AtlasPainter):
    """Draws the shapes of modes on the surface that the texels span.

    That surface is fine enough to show the bending.
    """

    def __init__(self, atlas: Atlas) -> None:
        fine = texel_atlas(atlas.texels)
        super().__init__(fine, np.ones((*atlas.areas.shape, 3)), with_grid=False)
        self._rest = self._vertices
        self._normals = fine.mesh.vertex_normals
        self._at_vertices = fine.sampling_matrix(fine.mesh.V)
        self._wave_matrix = atlas.stiffness()
        # as a share of the radius, in which the painter's vertices are
        self._radius = np.linalg.norm(np.ptp(fine.mesh.V, axis=0)) / np.linalg.norm(
            np.ptp(self._rest, axis=0)
        )
        self._highest = _MAX_SHEET_HEIGHT if _is_sheet(atlas) else _MAX_BODY_HEIGHT
        self._shape = np.zeros(atlas.areas.size)

    def mode(self, shape: NDArray[np.float64], view: View, size: int) -> NDArray[np.float64]:
        """RGBA image [size, size, 4] of a shape [C, n, n], of at most 1."""
        flat = self._shape = shape.ravel()
        wave_number = np.sqrt(
            flat @ (self._wave_matrix @ flat) / (flat @ (self._atlas.areas.ravel() * flat))
        )
        wave = 2 * np.pi / max(wave_number * self._radius, 1e-9)
        height = min(self._highest, _MAX_WAVE_HEIGHT * wave) * (self._at_vertices @ flat)
        self._vertices = self._rest + height[:, None] * self._normals
        F = self._atlas.mesh.F
        self._scene = RayScene(self._vertices, F)
        self._corner_normals = corner_normals(self._vertices, F)
        return self.mesh(view, size)

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
    thin = "xyz"[np.ptp(atlas.mesh.V, axis=0).argmin()]
    view = (
        View(up=thin, elevation=_SHEET_ELEVATION)
        if _is_sheet(atlas) and thin != "x"
        else View(up=up)
    )
    painter = ModePainter(atlas)
    figure = dressed(title, subtitle)
    left, bottom, width, height = _PLACE
    across, along = figure.get_size_inches() * figure.dpi
    count = len(found.shapes)
    size = round(min(_LARGEST, 1.2 * np.sqrt(width * across * height * along / count)))
    images = np.stack([painter.mode(shape, view, size) for shape in found.shapes])
    seen = images[..., 3].max(axis=0)
    rows, columns = (np.flatnonzero(seen.max(axis=axis)) for axis in (1, 0))
    # without the margin that all have
    images = images[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    aspect = images.shape[1] / images.shape[2]

    def scale(columns: int) -> float:
        """Width of the pictures [pixels]."""
        return min(
            _FILLED * width * across / columns,
            (height * along / -(-count // columns) - _CAPTION) / aspect,
        )

    most = max(range(1, count + 1), key=scale)  # pictures side by side
    pitch = width / most
    box = scale(most) / across
    for k, image in enumerate(images):
        row, column = divmod(k, most)
        x = left + (column + 0.5) * pitch
        y = bottom + height * (1 - row / -(-count // most))
        tall = aspect * box * across / along
        show(figure, (x - box / 2, y - tall, box, tall), image)
        frequency = found.frequencies[k]
        digits = max(0, 3 - int(np.floor(np.log10(frequency)))) if frequency else 0  # four in all
        caption = f"{k + 1}:  {frequency:.{digits}f} Hz"
        figure.text(
            x,
            y - tall - _CAPTION / 3 / along,
            caption,
            fontsize=12,
            color=TEXT,
            ha="center",
            va="center",
        )
    save_plot(figure, path)


def _is_sheet(atlas: Atlas) -> bool:
    extents = np.ptp(atlas.mesh.V, axis=0)
    return bool(extents.min() < _MAX_SHEET_THICKNESS * extents.max())
