"""How MuJoCo's textures lie on geoms and sites."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import MappingKind, Unit

from .visual import Visual

_GEOM = mujoco.mjtGeom
_MESHES = (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF)
_ROLES = (mujoco.mjtTextureRole.mjTEXROLE_RGB, mujoco.mjtTextureRole.mjTEXROLE_RGBA)

_WRAPPED = {
    _GEOM.mjGEOM_BOX: MappingKind.BOX_IMAGE,
    _GEOM.mjGEOM_SPHERE: MappingKind.BALL_IMAGE,
    _GEOM.mjGEOM_ELLIPSOID: MappingKind.BALL_IMAGE,
    _GEOM.mjGEOM_CYLINDER: MappingKind.CYLINDER_IMAGE,
    _GEOM.mjGEOM_CAPSULE: MappingKind.CAPSULE_IMAGE,
}

_WHOLE = 1.0, 1.0, 0.0, 0.0  # tiling with the texture once, not shifted


@dataclass(frozen=True, eq=False)
class TextureMapping:
    """How a texture lies on a visual.

    A point of the visual becomes coordinates. Of these the shader (texture_mapping.glsl) makes a
    position in a flat texture, which `tiling` scales and shifts, or a direction in a cube map.

    Attributes
    ----------
    kind : MappingKind
    texture : int
        Id of the texture, -1 without.
    scale : float64 [3]
        Coordinates a metre along the visual's axes; primitives extend from -1 to 1.
    own : bool
        Whether the mesh's own texture coordinates are used instead.
    tiling : tuple of 4 floats
        Scale and offset of a position in a flat texture.
    straight : float
        Half length of a capsule without its ends [m], 0 for everything else.
    stretch : float
        How much faster coordinates grow along z at a capsule's ends, which extend from 1 to 2.
    """

    kind: MappingKind = MappingKind.NO_IMAGE
    texture: int = -1
    scale: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))
    own: bool = False
    tiling: tuple[float, float, float, float] = _WHOLE
    straight: float = 0.0
    stretch: float = 1.0

    @property
    def unit(self) -> Unit:
        """Texture unit that shaders read the texture from."""
        return Unit.CUBE_IMAGE if self.kind == MappingKind.CUBE_IMAGE else Unit.FLAT_IMAGE

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for equal mappings."""
        return (
            self.kind,
            self.texture,
            self.scale.tobytes(),
            self.own,
            self.tiling,
            self.straight,
            self.stretch,
        )

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates [n, 3] of points [n, 3] of the visual, in its frame [m]."""
        coordinates = points * self.scale
        if self.straight > 0.0:
            beyond = points[:, 2] - np.clip(points[:, 2], -self.straight, self.straight)
            coordinates[:, 2] += beyond * (self.stretch - 1.0) * self.scale[2]
        return coordinates


def glow_texture(model: Any, visual: Visual, mapping: TextureMapping) -> int:
    """Id of the flat texture of what a visual emits, laid like its own texture; -1 without."""
    if visual.material < 0 or mapping.kind != MappingKind.FLAT_IMAGE:
        return -1
    texture = int(model.mat_texid[visual.material, mujoco.mjtTextureRole.mjTEXROLE_EMISSIVE])
    is_flat = texture >= 0 and model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    return texture if is_flat else -1


def mapping_of(model: Any, visual: Visual) -> TextureMapping:
    """How MuJoCo (3.12 and later) lays the texture of a visual's material on it.

    Flat textures go once round a round geom, with their left edge in the xz plane where x > 0 and
    their upper edge towards +z; a cylinder's discs, a capsule's ends and each face of a box carry a
    whole texture of their own. On height fields, and on meshes without texture coordinates, they
    are projected from above.
    """
    material = visual.material
    half = visual.half_sizes
    own_texture = visual.texture
    if own_texture is None:
        roles = [] if material < 0 else [int(model.mat_texid[material, role]) for role in _ROLES]
        texture = next((number for number in roles if number >= 0), -1)
    else:
        texture = own_texture.number
    if texture < 0 or model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
        return TextureMapping()
    cube = model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_CUBE
    uniform = bool(model.mat_texuniform[material]) if own_texture is None else own_texture.uniform
    repeat = np.array(
        model.mat_texrepeat[material] if own_texture is None else own_texture.repeat,
        dtype=np.float64,
    )
    times = np.where(repeat > 0, repeat, 1.0) * np.where((half[:2] > 0) & uniform, half[:2], 1.0)
    factor = np.where(half > 0, half, 1.0) if cube and uniform else np.ones(3)
    if visual.kind in _WRAPPED:  # by coordinates from -factor to factor
        kind = MappingKind.CUBE_IMAGE if cube else _WRAPPED[visual.kind]
        tiling = _WHOLE if cube else (*times, 0.0, 0.0)
        straight = 0.0
        stretch = 1.0
        if visual.kind == _GEOM.mjGEOM_CAPSULE:
            straight = half[2]
            stretch = half[2] / half[0]
        return TextureMapping(
            kind,
            texture,
            factor / half,
            tiling=tiling,
            straight=float(straight),
            stretch=float(stretch),
        )
    if cube:
        return TextureMapping(MappingKind.CUBE_IMAGE, texture, factor)
    if visual.kind in (_GEOM.mjGEOM_FLEX, _GEOM.mjGEOM_SKIN):
        return TextureMapping(MappingKind.FLAT_IMAGE, texture, own=True, tiling=(*repeat, 0.0, 0.0))
    if visual.kind in _MESHES and visual.asset >= 0 and model.mesh_texcoordadr[visual.asset] >= 0:
        return TextureMapping(MappingKind.FLAT_IMAGE, texture, own=True, tiling=(*times, 0.0, 0.0))
    if visual.kind == _GEOM.mjGEOM_PLANE:
        # from the corner of the plane, or from half a texture before the origin if the plane is
        # infinite
        endless = half[:2] <= 0
        scale = 0.5 * times / np.where(endless, 1.0, half[:2])
        offset = np.where(endless, 0.0, 0.5 * times) - 0.5 * endless.any()
        tiling = float(scale[0]), -float(scale[1]), float(offset[0]), float(offset[1])
        return TextureMapping(MappingKind.FLAT_IMAGE, texture, tiling=tiling)
    scale = 0.5 * (repeat if uniform else repeat / np.where(half[:2] > 0, half[:2], 1.0))
    return TextureMapping(MappingKind.FLAT_IMAGE, texture, tiling=(scale[0], -scale[1], -0.5, -0.5))
