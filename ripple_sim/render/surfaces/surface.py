"""`Surface`: the surface of a target as it is drawn: geometry, charts, look and texture.

A heatmap shows one of the solver's fields on it in false colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId
from ripple_sim.render.contract import MappingKind, Unit
from ripple_sim.render.height_map_textures import write_page
from ripple_sim.render.resources import Resources
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.render.visuals.texture_mapping import TextureMapping, mapping_of
from ripple_sim.render.visuals.visual import (
    MODEL_LOOK,
    Look,
    Visual,
    find_look,
    look_of,
    target_visual,
)
from ripple_sim.solver import Atlas
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.mesh.topology import undirected
from ripple_sim.solver.texels.chart_map import ChartMap
from ripple_sim.solver.texels.chart_page import ChartPage

from .tessellation import COORDINATES, NORMAL, POSITION

_BORDER_WIDTH = (
    1e-9  # a place is on the border of a chart if it is this close, in sides of the chart
)
_ATTRIBUTE_BITS = 36  # kept of the attributes of cut points: round-off is within the last bit

# Look of the surface under a heatmap: only its shadows are seen.
UNDER_HEATMAP = Look(color=(0.81, 0.81, 0.81), roughness=0.8)


class Charts(NamedTuple):
    """The charts of a surface.

    Attributes
    ----------
    map : ChartMap
        The way from the surface's mesh to the charts.
    page : ChartPage
        All of them on one page.
    """

    map: ChartMap
    page: ChartPage

    @classmethod
    def of(cls, atlas: Atlas) -> Charts:
        """The charts of an atlas."""
        return cls(atlas.chart_map, ChartPage(len(atlas.areas), atlas.resolution))


def split_at_charts(
    mesh: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]], charts: Charts
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Cut the triangles of a mesh where they leave a chart.

    The attributes of the vertices are linear in each triangle.

    Parameters
    ----------
    mesh : (F, attributes, same)
        See `tessellate`.

    Returns
    -------
    F, attributes, same
        The mesh. Every triangle lies in one chart; a vertex on a border exists once for each chart.
        `same` is equal for vertices that differ in their texture coordinates and charts at most.
    chart : int64 [n]
        Of each vertex.
    """
    F, attributes, same = mesh
    triangle, barycentrics, chart = charts.map.split(attributes[F][:, :, COORDINATES])
    whole = barycentrics.max(axis=2) == 1
    corner = barycentrics.argmax(axis=2)
    vertex = np.take_along_axis(F[triangle], corner, axis=1)
    part, place = np.nonzero(~whole)
    cut = np.einsum("ci,cij->cj", barycentrics[part, place], attributes[F[triangle[part]]])
    cut[:, NORMAL] /= np.maximum(np.linalg.norm(cut[:, NORMAL], axis=1, keepdims=True), 1e-12)
    # without the round-off by which two triangles differ in a point that they share
    step = np.ldexp(1.0, np.frexp(np.abs(attributes).max(axis=0))[1] - _ATTRIBUTE_BITS)
    cut = np.round(cut / step) * step
    _, point = np.unique(np.hstack([cut[:, POSITION], cut[:, NORMAL]]), axis=0, return_inverse=True)
    _, distinct = np.unique(cut, axis=0, return_inverse=True)
    source = np.where(whole, vertex, 0)
    alike = np.where(whole, vertex, 0)
    source[part, place] = len(attributes) + np.arange(len(cut))
    alike[part, place] = len(attributes) + distinct.ravel()
    key = alike * charts.page.charts + chart[:, None]
    _, where, index = np.unique(key, return_index=True, return_inverse=True)
    row = source.ravel()[where]
    attributes = np.concatenate([attributes, cut])[row]
    same = np.concatenate([same, int(same.max()) + 1 + point.ravel()])[row]
    return index.reshape(-1, 3), attributes, same, key.ravel()[where] % charts.page.charts


def shared_places(
    uv: NDArray[np.float64], places: NDArray[np.float64], points: NDArray
) -> NDArray[np.float64]:
    """Places [n, 2] on the page, equal for vertices at the same point, in all charts.

    Heights on both sides of a border are equal to round-off; looked up in one place they are
    the same, so that no gap opens. `points` [n, k] are equal where the vertices are at one point.
    """
    border = np.flatnonzero(((uv < _BORDER_WIDTH) | (uv > 1 - _BORDER_WIDTH)).any(axis=1))
    _, first, index = np.unique(points[border], axis=0, return_index=True, return_inverse=True)
    shared = places.copy()
    shared[border] = places[border[first[index.ravel()]]]
    return shared


class HeatmapTexture:
    """A field's values and their colours on the GPU, for surface.glsl.

    Parameters
    ----------
    page : ChartPage
        Of the target's charts.
    colors : array of uint8, shape [k, 3]
        sRGB, from the least to the greatest value.
    """

    def __init__(self, resources: Resources, page: ChartPage, colors: NDArray[np.uint8]) -> None:
        self._page = page
        self._shape = (page.charts, page.block, page.block)
        self._values = resources.clamped_texture((*page.size, 1), 1, dtype="f4")
        self._colors = resources.clamped_texture(
            (len(colors), 1), 3, data=colors.tobytes(), alignment=1
        )
        self.set(np.zeros(self._shape, np.float32), 1.0)

    def set(self, values: NDArray[np.float32], limit: float) -> None:
        """Replace the values, [C, n + 2, n + 2]; the colours range from -limit to limit.

        Raises `RippleError` if the shape is another, or the limit is not a positive, finite number.
        """
        if values.shape != self._shape:
            raise RippleError(
                f"the heatmap's values must have shape {list(self._shape)} (charts with a halo "
                f"of one texel), got {list(values.shape)}"
            )
        if not (np.isfinite(limit) and limit > 0):
            raise RippleError(
                f"the heatmap's limit must be a positive, finite number, got {limit!r}"
            )
        write_page(self._values, self._page, 0, values)
        self._limit = float(limit)

    def use(self, program: moderngl.Program) -> None:
        """Bind everything for a draw call."""
        self._values.use(Unit.HEATMAP)
        self._colors.use(Unit.HEATMAP_COLORS)
        program["heatmap_limit"] = self._limit


@dataclass(frozen=True)
class Surface:
    """Geometry and look of a target, in the frame of its MuJoCo geom.

    Attributes
    ----------
    V : array, shape [n, 3]
        Vertices [m].
    F : array, shape [m, 3]
        Triangles, counter-clockwise from outside.
    charts : Charts
        Of the target's atlas: where height map and heatmap are looked up.
    look : str
        Name of one of `LOOKS`; "model" takes colour, texture and gloss from the geom's MuJoCo
        material.
    color : tuple, optional
        sRGB, 0 to 1. By default the texture or colour that the model gives the geom, or else the
        look's own.
    grey : bool
        Whether MuJoCo's grey takes the place of the look's own colour.
    uv : array, optional
        Texture coordinates, shape [n, 2] or per corner [m, 3, 2].
    heatmap_colors : array of uint8, shape [k, 3], optional
        sRGB, from the least to the greatest value of a heatmap that replaces the look; see
        `Renderer.set_heatmap`.
    grid : int
        Texels between the lines of a grid on the surface; 0: no grid.
    moving : (V, F), optional
        The mesh on which the surface rides where it moves, if that is another one.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    charts: Charts
    look: str = "rubber"
    color: tuple[float, float, float] | None = None
    grey: bool = False
    uv: NDArray[np.float64] | None = None
    heatmap_colors: NDArray[np.uint8] | None = None
    grid: int = 0
    moving: tuple[NDArray[np.float64], NDArray[np.int64]] | None = None

    @property
    def open(self) -> bool:
        """Whether the surface has a rim."""
        edges, _ = undirected(np.asarray(self.F, dtype=np.int64))
        return bool((np.unique(edges, return_counts=True)[1] == 1).any())


def appearance(
    model: Any, visual: Visual, surface: Surface
) -> tuple[Look, NDArray[np.float64], TextureMapping]:
    """Look, linear colour under the texture, and texture mapping of the surface of a visual."""
    if surface.heatmap_colors is not None:
        return UNDER_HEATMAP, np.ones(3), TextureMapping()
    color = surface.color
    if color is None and surface.grey and not visual.colored:
        red, green, blue = visual.rgba[:3].tolist()
        color = red, green, blue
    return _painted(model, visual, surface.look, color, surface.uv is not None)


def painted(
    model: Any, target: TargetId, look: str, color: tuple[float, float, float] | None, has_uv: bool
) -> tuple[Look, NDArray[np.float64], TextureMapping]:
    """Look, linear colour under the texture, and texture mapping of a target.

    Parameters
    ----------
    look : str
        Name of one of `LOOKS`.
    color : tuple, optional
        sRGB; by default the model's or the look's.
    has_uv : bool
        Whether the target has texture coordinates of its own.
    """
    return _painted(model, target_visual(model, target), look, color, has_uv)


def _painted(
    model: Any, visual: Visual, look: str, color: tuple[float, float, float] | None, has_uv: bool
) -> tuple[Look, NDArray[np.float64], TextureMapping]:
    look_found = find_look(look)
    mapping = mapping_of(model, visual)
    if mapping.own and not has_uv:
        mapping = TextureMapping()
    if look == MODEL_LOOK:
        linear = visual.color if color is None else srgb_to_linear(color)
        return look_of(model, visual), linear, mapping
    if color is None and mapping.kind != MappingKind.NO_IMAGE:
        return look_found, visual.color, mapping
    linear = srgb_to_linear(_own_color(model, visual, look, color))
    return look_found, linear, TextureMapping()


def target_color(
    model: Any, target: TargetId, look: str, given: tuple[float, float, float] | None
) -> NDArray[np.float64]:
    """Colour of a target without its texture, sRGB [3].

    It is the given colour, or else the model's, or else the look's.
    """
    return _own_color(model, target_visual(model, target), look, given)


def _own_color(
    model: Any, visual: Visual, look: str, given: tuple[float, float, float] | None
) -> NDArray[np.float64]:
    if given is not None:
        return np.array(given)
    plain = mapping_of(model, visual).kind == MappingKind.NO_IMAGE
    return visual.rgba[:3] if visual.colored and plain else np.array(find_look(look).color)
