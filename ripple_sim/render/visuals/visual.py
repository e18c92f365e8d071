"""Visuals: the geoms and sites that a MuJoCo model shows, read alike, and their materials in the shaders' terms.

Looks are named sets of parameters for the surface of a target.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import first_flex, first_skin, is_soft
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.solver.errors import RippleError

from .flexes import flex_parts

# The look that takes colour, texture and gloss from the geom's MuJoCo material.
MODEL_LOOK = "model"


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
    "jelly": Look(color=(0.90, 0.07, 0.20), roughness=0.14, coat=0.8, translucency=0.7, transparency=0.5),
    "skin": Look(color=(0.87, 0.62, 0.52), roughness=0.48, sheen=0.3, coat=0.25, translucency=0.55),
    "clay": Look(color=(0.80, 0.52, 0.40), roughness=0.75, sheen=0.25),
    "metal": Look(color=(0.80, 0.81, 0.84), roughness=0.22, metallic=1.0),
    "water": Look(color=(0.42, 0.76, 0.90), roughness=0.06, coat=1.0, translucency=0.15, transparency=0.9),
    MODEL_LOOK: Look(color=(0.5, 0.5, 0.5), roughness=0.42, coat=0.2),
}


def find_look(name: str) -> Look:
    """Return the look called `name`, or raise `RippleError` with the valid names."""
    if name not in LOOKS:
        raise RippleError(f"look is {name!r}; valid are {', '.join(map(repr, LOOKS))}")
    return LOOKS[name]


_GEOM = mujoco.mjtGeom
_GEOM_OBJECT, _SITE_OBJECT = int(mujoco.mjtObj.mjOBJ_GEOM), int(mujoco.mjtObj.mjOBJ_SITE)
_SOLID = {*(int(getattr(mujoco.mjtObj, f"mjOBJ_{name}")) for name in ("GEOM", "SITE", "TENDON", "FLEX", "SKIN"))}
_VISIBLE_GROUPS = 3  # MuJoCo shows groups 0 to 2 by default
_UNSET = [0.5, 0.5, 0.5, 1.0]  # a geom's or site's colour where the MJCF gives none


@dataclass(frozen=True, eq=False)
class Visual:
    """A geom or a site as it is drawn, or something else of a scene of MuJoCo's: a contact, a tendon, a flex and so on.

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
        -1 without.
    group : int
    hull : bool
        Whether a mesh is drawn as its convex hull.
    identity : (int, int)
        Id and type, of `mujoco.mjtObj`, of what it shows.
    pose : (float32 [3], float32 [3, 3]), optional
        Where it is [m], and its rotation, of anything but geoms and sites.
    corners : float32 [3 m, 8], optional
        Points, normals and texture coordinates of the corners of a flex's or a skin's triangles.
    part : str
        Which part of a flex they are, see `flex_parts`.
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

    @property
    def visible(self) -> bool:
        """Whether MuJoCo shows it by default: in groups 0 to 2, and not fully transparent."""
        return self.group < _VISIBLE_GROUPS and self.opacity > 0.0

    @property
    def casts(self) -> bool:
        """Whether it casts shadows, as a geom, site, tendon, flex or skin does, and what explains a scene does not."""
        return self.identity[1] in _SOLID

    @property
    def color(self) -> NDArray[np.float64]:
        """Linear colour, shape [3]."""
        return srgb_to_linear(self.rgba[:3])

    @property
    def colored(self) -> bool:
        """Whether the model gives it a colour of its own; a material does."""
        return self.material >= 0 or not np.array_equal(self.rgba[:3], _UNSET[:3])

    @property
    def opacity(self) -> float:
        """0 to 1."""
        return float(self.rgba[3])

    @property
    def half_sizes(self) -> NDArray[np.float64]:
        """Half sizes of a primitive along its axes [m], a capsule's without its ends; 0 where a plane is infinite."""
        match self.kind:
            case _GEOM.mjGEOM_SPHERE if self.pose is None:
                return np.full(3, self.size[0])
            case _GEOM.mjGEOM_CAPSULE | _GEOM.mjGEOM_CYLINDER if self.pose is None:
                return self.size[[0, 0, 1]]
            case _:  # as a scene has those of all kinds
                return self.size


def geom_visual(model: Any, geom: int) -> Visual:
    """Geom of a model, or a soft target, see `find_soft`."""
    if is_soft(model, geom):
        skin = geom - first_skin(model)
        which, index = ("skin", skin) if skin >= 0 else ("flex", geom - first_flex(model))
        identity = index, int(mujoco.mjtObj.mjOBJ_SKIN if skin >= 0 else mujoco.mjtObj.mjOBJ_FLEX)
        paint = _paint(model, which, index)
        return Visual(False, geom, int(_GEOM.mjGEOM_MESH), np.ones(3), -1, *paint, identity=identity)
    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom], dtype=np.float64)
    asset, paint = int(model.geom_dataid[geom]), _paint(model, "geom", geom)
    return Visual(False, geom, kind, size, asset, *paint, identity=(geom, _GEOM_OBJECT))


def paint_of(model: Any, geom: int, look: str | None) -> tuple[str, tuple[float, float, float] | None]:
    """Look of a target in a model of the user's, and its sRGB colour, None where the model or the look says it.

    Without a look it is rubber in the grey that MuJoCo draws what has no colour in: nobody has asked for another.
    """
    visual = geom_visual(model, geom)
    red, green, blue = visual.rgba[:3].tolist()
    return look or "rubber", (red, green, blue) if look is None and not visual.colored else None


def site_visual(model: Any, site: int) -> Visual:
    """Site of a model."""
    kind, size = int(model.site_type[site]), np.array(model.site_size[site], dtype=np.float64)
    return Visual(True, site, kind, size, -1, *_paint(model, "site", site), identity=(site, _SITE_OBJECT))


def content_of(drawn: mujoco.MjvGeom) -> tuple[Any, ...]:
    """What an entry of a scene shows, but for the pose of a geom or site; a flex or skin always shows something new."""
    arrays = drawn.rgba.tobytes(), drawn.size.tobytes()
    content = drawn.objid, drawn.objtype, drawn.type, drawn.dataid, drawn.matid, *arrays
    if drawn.objtype in (_GEOM_OBJECT, _SITE_OBJECT):
        return content
    moving = object() if drawn.type in (_GEOM.mjGEOM_FLEX, _GEOM.mjGEOM_SKIN) else drawn.mat.tobytes()
    return *content, drawn.pos.tobytes(), moving


def visuals_in(model: Any, scene: mujoco.MjvScene, drawn: mujoco.MjvGeom) -> list[Visual]:
    """What an entry of a scene shows that MuJoCo made: one visual, but of a flex its faces, edges and vertices."""
    identity, kind = (int(drawn.objid), int(drawn.objtype)), int(drawn.type)
    paint: dict[str, Any] = {"rgba": np.array(drawn.rgba, dtype=np.float64), "material": int(drawn.matid)}
    if identity[1] == _SITE_OBJECT:
        return [replace(site_visual(model, identity[0]), **paint)]
    if identity[1] == _GEOM_OBJECT:  # of a mesh there is the convex hull, too, with the next id
        hull = kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF) and bool(drawn.dataid % 2)
        return [replace(geom_visual(model, identity[0]), hull=hull, **paint)]
    pose = np.array(drawn.pos), np.array(drawn.mat)
    size = np.array(drawn.size, dtype=np.float64)
    visual = Visual(False, -1, kind, size, -1, **paint, group=0, identity=identity, pose=pose)
    if kind not in (_GEOM.mjGEOM_FLEX, _GEOM.mjGEOM_SKIN):
        return [visual]
    in_world = replace(visual, pose=(np.zeros(3, np.float32), np.eye(3, dtype=np.float32)))
    if kind == _GEOM.mjGEOM_SKIN:
        return [replace(in_world, corners=_skin_corners(model, scene, identity[0]))]
    return [
        replace(in_world, corners=corners, part=part, material=in_world.material if part == "faces" else -1)
        for part, corners in flex_parts(model, scene, drawn).items()
    ]


def _skin_corners(model: Any, scene: mujoco.MjvScene, index: int) -> NDArray[np.float32]:
    """Corners of the triangles of a scene's skin, see `Visual`."""
    face, vertex = model.skin_faceadr[index], scene.skinvertadr[index]
    F = model.skin_face[face : face + model.skin_facenum[index]].ravel()
    points, normals = (array.reshape(-1, 3)[vertex + F] for array in (scene.skinvert, scene.skinnormal))
    start = model.skin_texcoordadr[index]
    uv = model.skin_texcoord[start + F] if start >= 0 else np.zeros((len(F), 2))
    return np.concatenate([points, normals, uv], axis=1, dtype=np.float32)


def _paint(model: Any, which: str, index: int) -> tuple[NDArray[np.float64], int, int]:
    """Colour, material and group of a geom, site, flex or skin."""
    rgba, material, group = (getattr(model, f"{which}_{name}")[index] for name in ("rgba", "matid", "group"))
    if material >= 0 and np.array_equal(rgba, _UNSET):
        rgba = model.mat_rgba[material]
    return np.array(rgba, dtype=np.float64), int(material), int(group)


def visible_geoms(model: Any) -> list[int]:
    """Ids of the geoms that MuJoCo shows by default."""
    return [geom for geom in range(model.ngeom) if geom_visual(model, geom).visible]


def visible_sites(model: Any) -> list[int]:
    """Ids of the sites that MuJoCo shows by default."""
    return [site for site in range(model.nsite) if site_visual(model, site).visible]


def host_of(model: Any, visual: Visual) -> int:
    """Geom that a visual belongs to: itself, or the nearest geom of a site's body; -1 if that has none."""
    if not visual.site:
        return visual.index
    near = np.flatnonzero(model.geom_bodyid == model.site_bodyid[visual.index])
    if not len(near):
        return -1
    return int(near[np.argmin(np.linalg.norm(model.geom_pos[near] - model.site_pos[visual.index], axis=1))])


def ball_of(model: Any, data: Any, visual: Visual) -> NDArray[np.float64]:
    """Bounding ball [1, 4] of a visual in the world; that of a plane is infinite."""
    if visual.corners is not None:
        points = visual.corners[:, :3]
        middle = points.mean(axis=0)
        return np.array([[*middle, np.linalg.norm(points - middle, axis=1).max(initial=0.0)]])
    if visual.pose is not None:
        return np.array([[*visual.pose[0], 2 * np.linalg.norm(visual.size)]])
    if visual.site:
        half = visual.half_sizes
        radius = float(np.linalg.norm(half) + half[0])  # a capsule has ends, too
        return np.array([[*data.site_xpos[visual.index], radius]])
    box, position = model.geom_aabb[visual.index], data.geom_xpos[visual.index]
    if visual.kind == _GEOM.mjGEOM_PLANE:
        return np.array([[*position, np.inf]])
    centre = position + data.geom_xmat[visual.index].reshape(3, 3) @ box[:3]
    return np.array([[*centre, np.linalg.norm(box[3:])]])


def look_of(model: Any, visual: Visual) -> Look:
    """Look of a visual's material; roughness is derived from MuJoCo's shininess where the material gives none."""
    red, green, blue = visual.color.tolist()
    rgb, material = (red, green, blue), visual.material
    if material < 0:
        return Look(color=rgb, roughness=0.42, coat=0.2)
    roughness, metallic = float(model.mat_roughness[material]), float(model.mat_metallic[material])
    if roughness < 0:
        roughness = 0.15 + 0.55 * (1.0 - float(model.mat_shininess[material]))
    return Look(
        color=rgb,
        roughness=float(np.clip(roughness, 0.05, 1.0)),
        metallic=max(metallic, 0.0),
        coat=min(0.4 * float(model.mat_specular[material]) + float(model.mat_reflectance[material]), 1.0),
        emission=float(model.mat_emission[material]),
    )


def texture_pixels(model: Any, texture: int) -> NDArray[np.uint8]:
    """Pixels of a model's texture, uint8 [height, width, 3], top row first."""
    height, width, channels = (int(n[texture]) for n in (model.tex_height, model.tex_width, model.tex_nchannel))
    start = int(model.tex_adr[texture])
    pixels = np.asarray(model.tex_data[start : start + height * width * channels]).reshape(height, width, channels)
    colors = np.repeat(pixels[..., :1], 3, axis=2) if channels < 3 else pixels[..., :3]
    return np.ascontiguousarray(colors, dtype=np.uint8)
