"""MuJoCo's materials and textures, as the shaders want them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from .color import SRGB8_ALPHA8, linear, srgb_texture
from .looks import Look
from .owned import OwnedObjects
from .pieces import Piece

_GEOM = mujoco.mjtGeom
_ROLES = (mujoco.mjtTextureRole.mjTEXROLE_RGB, mujoco.mjtTextureRole.mjTEXROLE_RGBA)
_MESHES = (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF)

# MAPPING of the geometry shaders: no picture, one by coordinates, a cube's, and flat ones wrapped round a primitive
NO_IMAGE, FLAT_IMAGE, CUBE_IMAGE, BOX_IMAGE, BALL_IMAGE, CYLINDER_IMAGE, CAPSULE_IMAGE = range(7)
_WRAPPED = {
    _GEOM.mjGEOM_BOX: BOX_IMAGE,
    _GEOM.mjGEOM_SPHERE: BALL_IMAGE,
    _GEOM.mjGEOM_ELLIPSOID: BALL_IMAGE,
    _GEOM.mjGEOM_CYLINDER: CYLINDER_IMAGE,
    _GEOM.mjGEOM_CAPSULE: CAPSULE_IMAGE,
}


def look_of(model: Any, piece: Piece) -> Look:
    """How a piece's material answers light; MuJoCo's shininess stands for roughness where the material gives none."""
    red, green, blue = (float(x) for x in piece.color)
    rgb = red, green, blue
    material = piece.material
    if material < 0:
        return Look(color=rgb, roughness=0.42, coat=0.2)
    roughness, metallic = float(model.mat_roughness[material]), float(model.mat_metallic[material])
    if roughness < 0:
        roughness = 0.15 + 0.55 * (1.0 - float(model.mat_shininess[material]))
    coat = 0.4 * float(model.mat_specular[material]) + float(model.mat_reflectance[material])
    return Look(
        color=rgb,
        roughness=float(np.clip(roughness, 0.05, 1.0)),
        metallic=max(metallic, 0.0),
        coat=min(coat, 1.0),
        emission=float(model.mat_emission[material]),
    )


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
    tiling : float64 [4]
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
    tiling: tuple[float, float, float, float] = (1.0, 1.0, 0.0, 0.0)
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
    texture = _texture(model, piece.material)
    if texture < 0:
        return Mapping()
    kind, material, half = piece.kind, piece.material, piece.half_sizes
    uniform = bool(model.mat_texuniform[material])
    primitive = kind in _WRAPPED
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE:
        scale = np.where(half > 0, half, 1.0) if uniform else np.ones(3)
        return _on_primitive(piece, CUBE_IMAGE, texture, scale) if primitive else Mapping(CUBE_IMAGE, texture, scale)
    repeat = np.array(model.mat_texrepeat[material], dtype=np.float64)
    own = kind in _MESHES and piece.asset >= 0 and model.mesh_texcoordadr[piece.asset] >= 0
    if primitive or own or kind == _GEOM.mjGEOM_PLANE:
        repeat = np.where(repeat > 0, repeat, 1.0)
        times = repeat * np.where((half[:2] > 0) & uniform, half[:2], 1.0)
        if primitive:
            return _on_primitive(piece, _WRAPPED[kind], texture, np.ones(3), (*times, 0.0, 0.0))
        if own:
            return Mapping(FLAT_IMAGE, texture, own=True, tiling=(*times, 0.0, 0.0))
        # the picture of a plane begins at its corner, or one half before the origin where it has no end
        endless = half[:2] <= 0
        scale = 0.5 * times / np.where(endless, 1.0, half[:2])
        offset = np.where(endless, 0.0, 0.5 * times) - 0.5 * endless.any()
        return Mapping(FLAT_IMAGE, texture, tiling=(scale[0], -scale[1], *offset))
    scale = 0.5 * (repeat if uniform else repeat / np.where(half[:2] > 0, half[:2], 1.0))
    return Mapping(FLAT_IMAGE, texture, tiling=(scale[0], -scale[1], -0.5, -0.5))


def _texture(model: Any, material: int) -> int:
    """Id of the texture that colours a material, -1 without."""
    roles = [] if material < 0 else [int(model.mat_texid[material, role]) for role in _ROLES]
    texture = next((texture for texture in roles if texture >= 0), -1)
    return -1 if texture >= 0 and model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX else texture


def _on_primitive(
    piece: Piece,
    kind: int,
    texture: int,
    factor: NDArray[np.float64],
    tiling: tuple[float, float, float, float] = (1.0, 1.0, 0.0, 0.0),
) -> Mapping:
    """Mapping by coordinates that reach from -factor to factor."""
    half = piece.half_sizes
    round_ends = piece.kind == _GEOM.mjGEOM_CAPSULE
    return Mapping(
        kind,
        texture,
        factor / half,
        tiling=tiling,
        straight=float(half[2]) if round_ends else 0.0,
        stretch=float(half[2] / half[0]) if round_ends else 1.0,
    )


class Textures:
    """The textures of a model on the GPU, each made at its first use."""

    def __init__(self, ctx: OwnedObjects, model: Any) -> None:
        self._ctx, self._model = ctx, model
        self._made: dict[int, moderngl.Texture | moderngl.TextureCube] = {}

    def get(self, texture: int) -> moderngl.Texture | moderngl.TextureCube:
        """Return the texture of an id; it reads as linear light."""
        if texture not in self._made:
            pixels = texture_pixels(self._model, texture)
            flat = self._model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
            self._made[texture] = srgb_texture(self._ctx, pixels) if flat else self._cube(pixels)
        return self._made[texture]

    def skybox(self) -> tuple[moderngl.TextureCube, NDArray[np.float64]] | None:
        """Return the model's skybox and its mean linear colour, or None."""
        for texture in range(self._model.ntex):
            if self._model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
                pixels = texture_pixels(self._model, texture)
                self._made[texture] = cube = self._cube(pixels)
                return cube, linear(pixels[::4, ::4] / 255.0).mean(axis=(0, 1))
        return None

    def _cube(self, pixels: NDArray[np.uint8]) -> moderngl.TextureCube:
        """Make a cube map of six faces below one another."""
        size = pixels.shape[1]
        if pixels.shape[0] != 6 * size:  # one picture for all faces
            pixels = np.concatenate([pixels[:size]] * 6)
        opaque = np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, dtype=np.uint8)], axis=2)
        cube = self._ctx.texture_cube((size, size), 4, opaque.tobytes(), internal_format=SRGB8_ALPHA8)
        cube.build_mipmaps()
        cube.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return cube


def texture_pixels(model: Any, texture: int) -> NDArray[np.uint8]:
    """Pixels of a model's texture, uint8 [height, width, 3], top row first."""
    height, width, channels = (int(n[texture]) for n in (model.tex_height, model.tex_width, model.tex_nchannel))
    start = int(model.tex_adr[texture])
    pixels = np.asarray(model.tex_data[start : start + height * width * channels]).reshape(height, width, channels)
    return np.ascontiguousarray(
        np.repeat(pixels[..., :1], 3, axis=2) if channels < 3 else pixels[..., :3], dtype=np.uint8
    )
