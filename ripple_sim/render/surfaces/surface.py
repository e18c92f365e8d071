"""The surface of a target as it is drawn: geometry, look and texture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.color import srgb_to_linear
from ripple_sim.render.contract import MappingKind
from ripple_sim.render.resources import Resources
from ripple_sim.render.textures import srgb_texture
from ripple_sim.render.visuals.looks import MODEL_LOOK, Look, find_look
from ripple_sim.render.visuals.materials import look_of
from ripple_sim.render.visuals.texture_mapping import Mapping, mapping_of
from ripple_sim.render.visuals.visual import geom_visual
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.files import read_image

from .charts import Charts
from .heatmap import UNDER_HEATMAP


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
        Name of one of `LOOKS`; "model" takes colour, texture and gloss from the geom's MuJoCo material.
    color : tuple, optional
        sRGB, 0 to 1. By default the texture or colour that the model gives the geom, or else the look's own.
    uv, image : optional
        Texture coordinates, shape [n, 2] or per corner [m, 3, 2], and the file of the texture.
    heatmap_colors : array of uint8, shape [k, 3], optional
        sRGB, from the least to the greatest value of a heatmap that replaces the look; see `Renderer.set_heatmap`.
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
    uv: NDArray[np.float64] | None = None
    image: Path | str | None = None
    heatmap_colors: NDArray[np.uint8] | None = None
    grid: int = 0
    moving: tuple[NDArray[np.float64], NDArray[np.int64]] | None = None

    @property
    def open(self) -> bool:
        """Whether it has a rim."""
        F = np.asarray(self.F, dtype=np.int64)
        ends = np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges = ends[:, 0] * (ends.max(initial=0) + 1) + ends[:, 1]  # one number an edge sorts ten times as fast as two
        return bool((np.unique(edges, return_counts=True)[1] == 1).any())


def appearance(model: Any, geom: int, surface: Surface) -> tuple[Look, NDArray[np.float64], Mapping]:
    """Look, linear colour under the texture, and how the texture lies on the surface."""
    plain, visual = Mapping(), geom_visual(model, geom)
    if surface.heatmap_colors is not None:
        return UNDER_HEATMAP, np.ones(3), plain
    look, mapping = find_look(surface.look), mapping_of(model, visual)
    if mapping.own and surface.uv is None:
        mapping = plain
    if surface.look == MODEL_LOOK:
        rgb = visual.color if surface.color is None else srgb_to_linear(surface.color)
        return look_of(model, visual), rgb, mapping
    if surface.image is not None and surface.uv is not None:
        return look, np.ones(3), Mapping(MappingKind.FLAT_IMAGE, own=True)
    if surface.color is None and mapping.kind != MappingKind.NO_IMAGE:
        return look, visual.color, mapping
    return look, srgb_to_linear(target_color(model, geom, surface.look, surface.color)), plain


def target_color(model: Any, geom: int, look: str, given: tuple[float, float, float] | None) -> NDArray[np.float64]:
    """Colour of a target without its texture, sRGB [3]: the given one, or else the model's own, or else the look's."""
    visual = geom_visual(model, geom)
    if given is not None:
        return np.array(given)
    plain = mapping_of(model, visual).kind == MappingKind.NO_IMAGE
    return visual.rgba[:3] if visual.colored and plain else np.array(find_look(look).color)


def load_image(resources: Resources, surface: Surface) -> moderngl.Texture:
    """Upload the texture of a surface, or raise `RippleError` if its file cannot be read."""
    pixels = read_image(RippleError, str(surface.image), "texture image", lambda mode: "RGB")
    return srgb_texture(resources, pixels)
