"""How MuJoCo's pictures lie on geoms and sites."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from .visual import Piece

_GEOM = mujoco.mjtGeom
_MESHES = (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF)
_ROLES = (mujoco.mjtTextureRole.mjTEXROLE_RGB, mujoco.mjtTextureRole.mjTEXROLE_RGBA)

# MAPPING of the geometry shaders: no picture, one by coordinates, a cube's, and flat ones wrapped round a primitive
NO_IMAGE, FLAT_IMAGE, CUBE_IMAGE, BOX_IMAGE, BALL_IMAGE, CYLINDER_IMAGE, CAPSULE_IMAGE = range(7)
_WRAPPED = {
    _GEOM.mjGEOM_BOX: BOX_IMAGE,
    _GEOM.mjGEOM_SPHERE: BALL_IMAGE,
    _GEOM.mjGEOM_ELLIPSOID: BALL_IMAGE,
    _GEOM.mjGEOM_CYLINDER: CYLINDER_IMAGE,
    _GEOM.mjGEOM_CAPSULE: CAPSULE_IMAGE,
}

_Tiling = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Mapping:
    """How a picture lies on a piece.

    A point of the piece becomes coordinates, the shader makes a place in a flat picture of them (see
    shaders/mapping.glsl) or the direction in a cube, and `tiling` scales and shifts that place.

    Attributes
    ----------
    kind : int
        One of the kinds above.
    texture : int
        Id of the texture, -1 without.
    scale : float64 [3]
        Coordinates a metre along the piece's axes; primitives reach from -1 to 1.
    own : bool
        The mesh's own texture coordinates are taken instead.
    tiling : tuple of 4 floats
        Scale and offset of a place in a flat picture.
    straight : float
        Half length of a capsule without its ends [m], 0 for all else.
    stretch : float
        By how much more coordinates grow along z at a capsule's ends, which reach from 1 to 2.
    """

    kind: int = NO_IMAGE
    texture: int = -1
    scale: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    own: bool = False
    tiling: _Tiling = (1.0, 1.0, 0.0, 0.0)
    straight: float = 0.0
    stretch: float = 1.0

    @property
    def unit(self) -> int:
        """Texture unit that the geometry shaders read the picture from."""
        return 6 if self.kind == CUBE_IMAGE else 5

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates [n, 3] of points [n, 3] of the piece in its frame [m]."""
        coordinates = points * self.scale
        if self.straight > 0.0:
            beyond = points[:, 2] - np.clip(points[:, 2], -self.straight, self.straight)
            coordinates[:, 2] += beyond * (self.stretch - 1.0) * self.scale[2]
        return coordinates


def mapping_of(model: Any, piece: Piece) -> Mapping:
    """How MuJoCo (3.12 and later) lays the texture of a piece's material on it.

    Flat pictures go once round what is round, with their left edge in the xz plane where x > 0 and their upper edge
    towards +z; a cylinder's discs, a capsule's ends and each face of a box carry a whole picture of their own. Meshes
    without texture coordinates and height fields are laid under them as seen from above.
    """
    texture, material, half = _texture(model, piece.material), piece.material, piece.half_sizes
    if texture < 0:
        return Mapping()
    uniform = bool(model.mat_texuniform[material])
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE:
        factor = np.where(half > 0, half, 1.0) if uniform else np.ones(3)
        if piece.kind in _WRAPPED:
            return _on_primitive(piece, CUBE_IMAGE, texture, factor, (1.0, 1.0, 0.0, 0.0))
        return Mapping(CUBE_IMAGE, texture, factor)
    repeat = np.array(model.mat_texrepeat[material], dtype=np.float64)
    times = np.where(repeat > 0, repeat, 1.0) * np.where((half[:2] > 0) & uniform, half[:2], 1.0)
    if piece.kind in _WRAPPED:
        return _on_primitive(piece, _WRAPPED[piece.kind], texture, np.ones(3), (*times, 0.0, 0.0))
    if piece.kind in _MESHES and piece.asset >= 0 and model.mesh_texcoordadr[piece.asset] >= 0:
        return Mapping(FLAT_IMAGE, texture, own=True, tiling=(*times, 0.0, 0.0))
    if piece.kind == _GEOM.mjGEOM_PLANE:
        return Mapping(FLAT_IMAGE, texture, tiling=_on_plane(half[:2], times))
    scale = 0.5 * (repeat if uniform else repeat / np.where(half[:2] > 0, half[:2], 1.0))
    return Mapping(FLAT_IMAGE, texture, tiling=(scale[0], -scale[1], -0.5, -0.5))


def _texture(model: Any, material: int) -> int:
    """Id of the texture that colours a material, -1 without."""
    roles = [] if material < 0 else [int(model.mat_texid[material, role]) for role in _ROLES]
    texture = next((texture for texture in roles if texture >= 0), -1)
    return -1 if texture >= 0 and model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX else texture


def _on_primitive(piece: Piece, kind: int, texture: int, factor: NDArray[np.float64], tiling: _Tiling) -> Mapping:
    """Mapping by coordinates that reach from -factor to factor."""
    half, round_ends = piece.half_sizes, piece.kind == _GEOM.mjGEOM_CAPSULE
    return Mapping(
        kind,
        texture,
        factor / half,
        tiling=tiling,
        straight=float(half[2]) if round_ends else 0.0,
        stretch=float(half[2] / half[0]) if round_ends else 1.0,
    )


def _on_plane(half: NDArray[np.float64], times: NDArray[np.float64]) -> _Tiling:
    """Tiling that begins at the corner of a plane, or half a picture before the origin where it has no end."""
    endless = half <= 0
    scale = 0.5 * times / np.where(endless, 1.0, half)
    offset = np.where(endless, 0.0, 0.5 * times) - 0.5 * endless.any()
    return (float(scale[0]), -float(scale[1]), float(offset[0]), float(offset[1]))
