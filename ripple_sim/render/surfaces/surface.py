"""What is drawn as a target: its geometry, its look, and the picture that it wears."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.render.gpu.color import linear, srgb_texture
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.render.visuals.looks import MODEL_LOOK, Look, find_look
from ripple_sim.render.visuals.materials import look_of
from ripple_sim.render.visuals.texture_mapping import FLAT_IMAGE, NO_IMAGE, Mapping, mapping_of
from ripple_sim.render.visuals.visual import geom_piece
from ripple_sim.solver.errors import RippleError

from .scalar_field import UNDER_COLORS


@dataclass(frozen=True)
class Surface:
    """Geometry and look of a target, in the frame of its MuJoCo geom.

    Attributes
    ----------
    V : array, shape [n, 3]
        Vertices [m].
    F : array, shape [m, 3]
        Triangles, counter-clockwise from outside.
    sphere : array, shape [n, 3]
        Unit vectors: where the height map is looked up.
    resolution : int
        Texels N per edge of the height map's faces.
    look : str
        Name of one of `LOOKS`; "model" takes colour, texture and gloss from the geom's MuJoCo material.
    color : tuple, optional
        sRGB, 0 to 1. By default the texture of the geom's MuJoCo material, if it has one, or else the look's own.
    uv, image : optional
        Texture coordinates, shape [n, 2] or per corner [m, 3, 2], and the picture that they index.
    field_colors : array of uint8, shape [k, 3], optional
        sRGB, from the least to the greatest value of a scalar field that is drawn in place of the look; see
        `SurfaceMesh.set_field`.
    grid : int
        Texels between the lines of a grid that is drawn on the surface; 0: none.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    sphere: NDArray[np.float64]
    resolution: int
    look: str = "rubber"
    color: tuple[float, float, float] | None = None
    uv: NDArray[np.float64] | None = None
    image: Path | str | None = None
    field_colors: NDArray[np.uint8] | None = None
    grid: int = 0


def appearance(model: Any, geom: int, surface: Surface) -> tuple[Look, NDArray[np.float64], Mapping]:
    """Look, linear colour under the picture, and how the picture lies on the surface."""
    plain, piece = Mapping(), geom_piece(model, geom)
    if surface.field_colors is not None:
        return UNDER_COLORS, np.ones(3), plain
    look, mapping = find_look(surface.look), mapping_of(model, piece)
    if mapping.own and surface.uv is None:
        mapping = plain
    if surface.look == MODEL_LOOK:
        rgb = piece.color if surface.color is None else linear(surface.color)
        return look_of(model, piece), rgb, mapping
    if surface.image is not None and surface.uv is not None:
        return look, np.ones(3), Mapping(FLAT_IMAGE, own=True)
    if surface.color is None and mapping.kind != NO_IMAGE:
        return look, piece.color, mapping
    return look, linear(surface.color or look.color), plain


def load_image(ctx: OwnedObjects, surface: Surface) -> moderngl.Texture:
    """Put the picture of a surface on the GPU, or raise `RippleError` if it cannot be read."""
    try:
        picture = Image.open(str(surface.image)).convert("RGB")
    except OSError as error:
        raise RippleError(f"texture image {surface.image} cannot be read: {error}") from error
    return srgb_texture(ctx, np.asarray(picture))
