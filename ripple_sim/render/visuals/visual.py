"""Visuals: the geoms and sites that a MuJoCo model shows, and their materials for the shaders.

A look is a named set of parameters for the surface of a target.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import GeomId, TargetId, flex_of, geom_id, is_geom, skin_of
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.solver.errors import RippleError

# The look that takes colour, texture and gloss from the geom's MuJoCo material.
MODEL_LOOK = "model"
# The part of a height field that does not ripple.
WALLS = "walls"

_GEOM = mujoco.mjtGeom
GEOM_OBJECT = int(mujoco.mjtObj.mjOBJ_GEOM)
SITE_OBJECT = int(mujoco.mjtObj.mjOBJ_SITE)
_VISIBLE_GROUPS = 3  # MuJoCo shows groups 0 to 2 by default
_DEFAULT_RGBA = [0.5, 0.5, 0.5, 1.0]  # of a geom or site where the MJCF gives no colour
_HALF_CLEAR = (6, 241)  # opacities of texels that are neither clear nor opaque, as in opacity.glsl


@dataclass(frozen=True)
class Look:
    """Parameters of the surface shader.

    Attributes
    ----------
    color : tuple
        sRGB, 0 to 1; used where the surface has no colour of its own.
    roughness : float
        Of the microfacet distribution, 0 (mirror) to 1.
    metallic : float
        0 dielectric, 1 metal.
    sheen : float
        Strength of the soft glow towards the silhouette.
    coat : float
        Strength of a clear, smooth coat above the base layer, 0 to 1.
    translucency : float
        Share of the light that enters the object and leaves it elsewhere, 0 to 1.
    transparency : float
        Share of the base layer through which the surroundings are seen, refracted, 0 to 1.
    emission : float
        Radiance of its own, in units of its colour.
    """

    color: tuple[float, float, float]
    roughness: float
    metallic: float = 0.0
    sheen: float = 0.0
    coat: float = 0.0
    translucency: float = 0.0
    transparency: float = 0.0
    emission: float = 0.0


LOOKS: dict[str, Look] = {
    "rubber": Look(color=(1.0, 0.80, 0.05), roughness=0.36, sheen=0.15, coat=0.6, translucency=0.3),
    "jelly": Look(
        color=(0.90, 0.07, 0.20), roughness=0.14, coat=0.8, translucency=0.7, transparency=0.5
    ),
    "skin": Look(color=(0.87, 0.62, 0.52), roughness=0.48, sheen=0.3, coat=0.25, translucency=0.55),
    "clay": Look(color=(0.80, 0.52, 0.40), roughness=0.75, sheen=0.25),
    "metal": Look(color=(0.80, 0.81, 0.84), roughness=0.22, metallic=1.0),
    "water": Look(
        color=(0.42, 0.76, 0.90), roughness=0.06, coat=1.0, translucency=0.15, transparency=0.9
    ),
    MODEL_LOOK: Look(color=(0.5, 0.5, 0.5), roughness=0.42, coat=0.2),
}


def find_look(name: str) -> Look:
    """Return the look called `name`, or raise `RippleError` with the valid names."""
    if name not in LOOKS:
        raise RippleError(f"look must be one of {', '.join(map(repr, LOOKS))}, got {name!r}")
    return LOOKS[name]


class Finish(NamedTuple):
    """How a surface reflects light, as MuJoCo's materials say; by default without a material."""

    emission: float = 0.0
    specular: float = 0.5
    shininess: float = 0.5
    reflectance: float = 0.0


class SceneTexture(NamedTuple):
    """A texture of the model, by its id, and how it is repeated; see `mapping_of`."""

    number: int
    repeat: tuple[float, float]
    uniform: bool


@dataclass(frozen=True, eq=False)
class Visual:
    """A geom or a site as it is drawn, or another entry of a MuJoCo scene, such as a contact.

    Attributes
    ----------
    site : bool
    index : int
        Among the model's geoms or sites; -1 for anything else.
    kind : int
        Of `mujoco.mjtGeom`.
    size : float64 [3]
        As the MJCF gives it [m].
    asset : int
        Id of its mesh or height field, -1 without.
    rgba : float64 [4]
        sRGB and opacity: its own, or else its material's.
    material : int
        Id of the material, -1 without.
    group : int
    hull : bool
        Whether a mesh is drawn as its convex hull.
    identity : (int, int)
        Id and type, of `mujoco.mjtObj`, of the object that it shows.
    pose : (float32 [3], float32 [3, 3]), optional
        Position [m] and rotation of a visual that is no geom or site.
    corners : float32 [3 m, 8], optional
        Points, normals and texture coordinates of the corners of a flex's or a skin's triangles.
    part : str
        The part of a flex to which the corners belong, see `flex_parts`; or `WALLS`: of a height
        field without its ground.
    finish : Finish, optional
        Of a scene; by default the material's.
    texture : SceneTexture, optional
        Of a scene, in place of the material's.
    decor : bool
        Whether it explains a scene, and casts no shadow.
    half_size : float64 [3], optional
        Half sizes along its axes, of a scene, in place of `size` [m].
    box : (float64 [3], float64 [3]), optional
        Centre and half sizes of its bounding box in its own frame [m], for a visual that has an
        asset and is no geom.
    behind : bool
        Whether it is a plane that is seen from behind.
    shown_opacity : float, optional
        Opacity with which it is seen, if it is not its own.
    """

    site: bool
    index: int
    kind: int
    size: NDArray[np.float64]
    asset: int
    rgba: NDArray[np.float64]
    material: int
    group: int
    hull: bool = False
    identity: tuple[int, int] = (-1, -1)
    pose: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
    corners: NDArray[np.float32] | None = None
    part: str = ""
    behind: bool = False
    shown_opacity: float | None = None
    finish: Finish | None = None
    texture: SceneTexture | None = None
    decor: bool = False
    half_size: NDArray[np.float64] | None = None
    box: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def visible(self) -> bool:
        """Whether MuJoCo shows it by default: in groups 0 to 2, and not fully transparent."""
        return self.group < _VISIBLE_GROUPS and self.opacity > 0.0

    @property
    def casts(self) -> bool:
        """Whether it casts shadows: all but lines and decorative geoms do, as in MuJoCo."""
        return not self.decor and self.kind != _GEOM.mjGEOM_LINE

    @property
    def color(self) -> NDArray[np.float64]:
        """Linear colour, shape [3]."""
        return srgb_to_linear(self.rgba[:3])

    @property
    def colored(self) -> bool:
        """Whether the model or a material gives the visual a colour."""
        return self.material >= 0 or not np.array_equal(self.rgba[:3], _DEFAULT_RGBA[:3])

    @property
    def opacity(self) -> float:
        """Opacity with which it is seen, 0 to 1."""
        return float(self.rgba[3]) if self.shown_opacity is None else self.shown_opacity

    @property
    def passes(self) -> float:
        """Share of the light that passes, 0 to 1."""
        return 1.0 - float(self.rgba[3])

    @property
    def half_sizes(self) -> NDArray[np.float64]:
        """Half sizes of a primitive along its axes [m].

        A capsule's are without its ends; a plane's are 0 where it is infinite.
        """
        if self.half_size is not None:
            return self.half_size
        match self.kind:
            case _GEOM.mjGEOM_SPHERE:
                return np.full(3, self.size[0])
            case _GEOM.mjGEOM_CAPSULE | _GEOM.mjGEOM_CYLINDER:
                return self.size[[0, 0, 1]]
            case _:
                return self.size


def target_visual(model: Any, target: TargetId) -> Visual:
    """Visual of a geom, a flex or a skin."""
    if is_geom(target, model):
        return geom_visual(model, target)
    number: int = skin_of(model, target)
    if number >= 0:
        identity = number, int(mujoco.mjtObj.mjOBJ_SKIN)
        paint = _paint(model, "skin", number)
    else:
        number = flex_of(model, target)
        identity = number, int(mujoco.mjtObj.mjOBJ_FLEX)
        paint = _paint(model, "flex", number)
    kind = int(_GEOM.mjGEOM_MESH)
    return Visual(False, target, kind, np.ones(3), -1, *paint, identity=identity)


def geom_visual(model: Any, geom: GeomId) -> Visual:
    """Visual of a geom of a model."""
    kind = int(model.geom_type[geom])
    size = np.array(model.geom_size[geom], dtype=np.float64)
    asset = int(model.geom_dataid[geom])
    paint = _paint(model, "geom", geom)
    return Visual(False, geom, kind, size, asset, *paint, identity=(geom, GEOM_OBJECT))


def paint_of(
    model: Any, target: TargetId, look: str | None
) -> tuple[str, tuple[float, float, float] | None]:
    """Look and sRGB colour of a target in a user's model.

    The colour is None where the model or the look has one. A target without look and colour is
    rubber in the grey of MuJoCo's geoms without a colour.
    """
    visual = target_visual(model, target)
    red, green, blue = visual.rgba[:3].tolist()
    is_grey = look is None and not visual.colored
    return look or "rubber", (red, green, blue) if is_grey else None


def site_visual(model: Any, site: int) -> Visual:
    """Site of a model."""
    kind = int(model.site_type[site])
    size = np.array(model.site_size[site], dtype=np.float64)
    paint = _paint(model, "site", site)
    return Visual(True, site, kind, size, -1, *paint, identity=(site, SITE_OBJECT))


def _paint(model: Any, which: str, index: int) -> tuple[NDArray[np.float64], int, int]:
    """Colour, material and group of a geom, site, flex or skin."""
    rgba = getattr(model, f"{which}_rgba")[index]
    material = getattr(model, f"{which}_matid")[index]
    group = getattr(model, f"{which}_group")[index]
    if material >= 0 and np.array_equal(rgba, _DEFAULT_RGBA):
        rgba = model.mat_rgba[material]
    return np.array(rgba, dtype=np.float64), int(material), int(group)


def visible_geoms(model: Any) -> list[GeomId]:
    """The geoms that MuJoCo shows by default."""
    geoms = map(geom_id, range(model.ngeom))
    return [geom for geom in geoms if geom_visual(model, geom).visible]


def visible_sites(model: Any) -> list[int]:
    """Ids of the sites that MuJoCo shows by default."""
    return [site for site in range(model.nsite) if site_visual(model, site).visible]


def host_of(model: Any, visual: Visual) -> int:
    """Geom that a visual belongs to: itself, or the geom of a site's body nearest to the site.

    It is -1 if the body has no geom.
    """
    if not visual.site:
        return visual.index
    near = np.flatnonzero(model.geom_bodyid == model.site_bodyid[visual.index])
    if not len(near):
        return -1
    distances = np.linalg.norm(model.geom_pos[near] - model.site_pos[visual.index], axis=1)
    return int(near[np.argmin(distances)])


def box_of(model: Any, visual: Visual) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centre and half sizes of the box about a visual that is no plane, in its own frame [m]."""
    half = visual.half_sizes
    match visual.kind:
        case (
            _GEOM.mjGEOM_SPHERE | _GEOM.mjGEOM_ELLIPSOID | _GEOM.mjGEOM_CYLINDER | _GEOM.mjGEOM_BOX
        ):
            return np.zeros(3), half
        case _GEOM.mjGEOM_CAPSULE:
            return np.zeros(3), half + np.array([0.0, 0.0, half[0]])
    if visual.box is not None:
        return visual.box
    box = model.geom_aabb[visual.index]
    return box[:3], box[3:]


def ball_of(model: Any, data: Any, visual: Visual) -> NDArray[np.float64]:
    """Bounding ball [1, 4] of a visual in the world; infinite for an infinite plane."""
    if visual.corners is not None:
        points = visual.corners[:, :3]
        middle = points.mean(axis=0)
        return np.array([[*middle, np.linalg.norm(points - middle, axis=1).max(initial=0.0)]])
    if visual.pose is not None:
        position, rotation = visual.pose
        if visual.kind == _GEOM.mjGEOM_PLANE:
            half = visual.half_sizes[:2]
            return np.array([[*position, np.linalg.norm(half) if half.all() else np.inf]])
        centre = np.zeros(3)
        half = 2 * visual.half_sizes
        if visual.box is not None:
            centre, half = visual.box
        elif visual.kind == _GEOM.mjGEOM_LINE:  # its other sizes are in pixels
            centre = half = visual.half_sizes * [0, 0, 0.5]
        return np.array([[*(position + rotation @ centre), np.linalg.norm(half)]])
    if visual.site:
        half = visual.half_sizes
        radius = float(np.linalg.norm(half) + half[0])  # with the ends of a capsule
        return np.array([[*data.site_xpos[visual.index], radius]])
    position = data.geom_xpos[visual.index]
    if visual.kind == _GEOM.mjGEOM_PLANE:
        half = visual.half_sizes[:2]
        return np.array([[*position, np.linalg.norm(half) if half.all() else np.inf]])
    middle, half = box_of(model, visual)
    centre = position + data.geom_xmat[visual.index].reshape(3, 3) @ middle
    return np.array([[*centre, np.linalg.norm(half)]])


def finish_of(model: Any, visual: Visual) -> Finish:
    """Finish of a visual: of the scene's entry, or else of its material."""
    material = visual.material
    if visual.finish is not None or material < 0:
        return visual.finish or Finish()
    return Finish(*(float(getattr(model, f"mat_{name}")[material]) for name in Finish._fields))


def look_of(model: Any, visual: Visual) -> Look:
    """Look of the material of a visual.

    Roughness is derived from MuJoCo's shininess where the material gives none.
    """
    red, green, blue = visual.color.tolist()
    rgb = (red, green, blue)
    material = visual.material
    finish = finish_of(model, visual)
    if material < 0 and finish == Finish():
        return Look(color=rgb, roughness=0.42, coat=0.2)
    roughness = -1.0
    metallic = 0.0
    if material >= 0:
        roughness = float(model.mat_roughness[material])
        metallic = float(model.mat_metallic[material])
    if roughness < 0:
        roughness = 0.15 + 0.55 * (1.0 - finish.shininess)
    return Look(
        color=rgb,
        roughness=float(np.clip(roughness, 0.05, 1.0)),
        metallic=max(metallic, 0.0),
        coat=float(np.clip(0.4 * finish.specular + finish.reflectance, 0.0, 1.0)),
        emission=finish.emission,
    )


def texture_pixels(model: Any, texture: int) -> NDArray[np.uint8]:
    """Pixels of a model's texture, uint8 [height, width, 3], top row first."""
    pixels = _stored_pixels(model, texture)
    colors = np.repeat(pixels[..., :1], 3, axis=2) if pixels.shape[2] < 3 else pixels[..., :3]
    return np.ascontiguousarray(colors, dtype=np.uint8)


def texture_pixels_with_opacity(model: Any, texture: int) -> NDArray[np.uint8]:
    """Like `texture_pixels`, with opacity as a fourth channel where the texture has opacity."""
    if not texture_has_opacity(model, texture):
        return texture_pixels(model, texture)
    return np.ascontiguousarray(_stored_pixels(model, texture))


def texture_has_opacity(model: Any, texture: int) -> bool:
    """Whether a model's texture is a flat one with opacity.

    A target has holes where the texture is clear, and is transparent where it is clear in part.
    """
    is_flat = model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    return bool(is_flat and model.tex_nchannel[texture] == 4)


def texture_is_half_clear(model: Any, texture: int) -> bool:
    """Whether a model's texture has texels that are neither opaque nor clear."""
    if not texture_has_opacity(model, texture):
        return False
    opacity = _stored_pixels(model, texture)[..., 3]
    low, high = _HALF_CLEAR
    return bool(((opacity >= low) & (opacity <= high)).any())


def _stored_pixels(model: Any, texture: int) -> NDArray[np.uint8]:
    """Pixels as the model stores them, [height, width, channels]."""
    height = int(model.tex_height[texture])
    width = int(model.tex_width[texture])
    channels = int(model.tex_nchannel[texture])
    start = int(model.tex_adr[texture])
    content = np.asarray(model.tex_data[start : start + height * width * channels])
    return content.reshape(height, width, channels)
