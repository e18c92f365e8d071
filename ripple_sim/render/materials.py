"""MuJoCo's materials and textures, as the shaders want them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from .color import SRGB8_ALPHA8, linear, srgb_texture
from .looks import Look
from .owned import OwnedObjects

_GEOM = mujoco.mjtGeom
_ROLES = (mujoco.mjtTextureRole.mjTEXROLE_RGB, mujoco.mjtTextureRole.mjTEXROLE_RGBA)
_MESHES = (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF)

NO_IMAGE, FLAT_IMAGE, CUBE_IMAGE = range(3)  # MAPPING of the geometry shaders


def color(model: Any, geom: int) -> NDArray[np.float64]:
    """Linear colour and opacity of a geom: its own, or its material's where it has none of its own."""
    rgba = np.asarray(model.geom_rgba[geom], dtype=np.float64)
    material = model.geom_matid[geom]
    if material >= 0 and np.array_equal(rgba, [0.5, 0.5, 0.5, 1.0]):
        rgba = np.asarray(model.mat_rgba[material], dtype=np.float64)
    return np.append(linear(rgba[:3]), rgba[3])


def look_of(model: Any, geom: int) -> Look:
    """How a geom's material answers light; MuJoCo's shininess stands for roughness where the material gives none."""
    material = model.geom_matid[geom]
    red, green, blue = (float(x) for x in color(model, geom)[:3])
    rgb = red, green, blue
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


@dataclass(frozen=True)
class Mapping:
    """How a geom's texture lies on it.

    Attributes
    ----------
    kind : int
        NO_IMAGE, FLAT_IMAGE or CUBE_IMAGE.
    texture : int
        Id of the texture, -1 without.
    scale : array, shape [3]
        Texture coordinates a metre, in the geom's frame, where a flat image's begin at -0.5; or how often the mesh's
        own ones are repeated.
    own : bool
        Whether the mesh's own texture coordinates are used.
    """

    kind: int
    texture: int
    scale: NDArray[np.float64]
    own: bool

    @property
    def unit(self) -> int:
        """Texture unit that the geometry shaders read the image from."""
        return 6 if self.kind == CUBE_IMAGE else 5


def mapping_of(model: Any, geom: int) -> Mapping:
    """How MuJoCo lays the texture of a geom's material on it."""
    material = model.geom_matid[geom]
    textures = [] if material < 0 else [int(model.mat_texid[material, role]) for role in _ROLES]
    texture = max(textures, default=-1)
    if texture < 0 or model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
        return Mapping(NO_IMAGE, -1, np.zeros(3), False)
    kind, size = int(model.geom_type[geom]), _half_sizes(model, geom)
    uniform = bool(model.mat_texuniform[material])
    if model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE:
        shaped = kind in _MESHES or kind == _GEOM.mjGEOM_HFIELD
        scale = np.ones(3) if uniform or shaped else 1.0 / np.where(size > 0, size, 1.0)
        return Mapping(CUBE_IMAGE, texture, scale, False)
    mesh = int(model.geom_dataid[geom])
    own = kind in _MESHES and mesh >= 0 and model.mesh_texcoordadr[mesh] >= 0
    repeat = np.asarray(model.mat_texrepeat[material], dtype=np.float64)
    if own:
        return Mapping(FLAT_IMAGE, texture, np.array([repeat[0], repeat[1], 0.0]), True)
    if not uniform:
        repeat = repeat / np.where(size[:2] > 0, size[:2], 1.0)
    return Mapping(FLAT_IMAGE, texture, np.array([0.5 * repeat[0], -0.5 * repeat[1], 0.0]), False)


def _half_sizes(model: Any, geom: int) -> NDArray[np.float64]:
    """Half sizes of a geom's box [m], shape [3]; 0 where a plane has no end."""
    size = np.asarray(model.geom_size[geom], dtype=np.float64)
    match model.geom_type[geom]:
        case _GEOM.mjGEOM_SPHERE:
            return np.full(3, size[0])
        case _GEOM.mjGEOM_CAPSULE | _GEOM.mjGEOM_CYLINDER:
            return np.array([size[0], size[0], size[1]])
        case _:
            return size


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
