"""Visuals: the geoms and sites that a MuJoCo model shows, read alike, and their materials in the shaders' terms.

Looks are named sets of parameters for the surface of a target.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import first_flex, first_skin, is_soft
from ripple_sim.render.contract import srgb_to_linear
from ripple_sim.solver.errors import RippleError

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
_VISIBLE_GROUPS = 3  # MuJoCo shows groups 0 to 2 by default
_UNSET = [0.5, 0.5, 0.5, 1.0]  # a geom's or site's colour where the MJCF gives none


@dataclass(frozen=True, eq=False)
class Visual:
    """A geom or a site as it is drawn.

    Attributes
    ----------
    site : bool
    index : int
        Among the model's geoms or sites.
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
    """

    site: bool
    index: int
    kind: int
    size: NDArray[np.float64]
    asset: int
    rgba: NDArray[np.float64]
    material: int
    group: int

    @property
    def visible(self) -> bool:
        """Whether MuJoCo shows it by default: in groups 0 to 2, and not fully transparent."""
        return self.group < _VISIBLE_GROUPS and self.opacity > 0.0

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
            case _GEOM.mjGEOM_SPHERE:
                return np.full(3, self.size[0])
            case _GEOM.mjGEOM_CAPSULE | _GEOM.mjGEOM_CYLINDER:
                return self.size[[0, 0, 1]]
            case _:
                return self.size


def geom_visual(model: Any, geom: int) -> Visual:
    """Geom of a model, or a soft target, see `soft_ids`."""
    if is_soft(model, geom):
        return _soft_visual(model, geom)
    return _visual(model, "geom", geom, int(model.geom_dataid[geom]))


def _soft_visual(model: Any, target: int) -> Visual:
    skin = target - first_skin(model)
    which, index = ("skin", skin) if skin >= 0 else ("flex", target - first_flex(model))
    rgba, material, group = (getattr(model, f"{which}_{name}")[index] for name in ("rgba", "matid", "group"))
    rgba = np.array(model.mat_rgba[material] if material >= 0 and np.array_equal(rgba, _UNSET) else rgba, np.float64)
    return Visual(False, target, int(_GEOM.mjGEOM_MESH), np.ones(3), -1, rgba, int(material), int(group))


def site_visual(model: Any, site: int) -> Visual:
    """Site of a model."""
    return _visual(model, "site", site, -1)


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
    if visual.site:
        half = visual.half_sizes
        radius = float(np.linalg.norm(half) + half[0])  # a capsule has ends, too
        return np.array([[*data.site_xpos[visual.index], radius]])
    box, position = model.geom_aabb[visual.index], data.geom_xpos[visual.index]
    if visual.kind == _GEOM.mjGEOM_PLANE:
        return np.array([[*position, np.inf]])
    centre = position + data.geom_xmat[visual.index].reshape(3, 3) @ box[:3]
    return np.array([[*centre, np.linalg.norm(box[3:])]])


def _visual(model: Any, which: str, index: int, asset: int) -> Visual:
    def value(name: str) -> Any:
        return getattr(model, f"{which}_{name}")[index]

    rgba, material = np.array(value("rgba"), dtype=np.float64), int(value("matid"))
    if material >= 0 and np.array_equal(rgba, _UNSET):
        rgba = np.array(model.mat_rgba[material], dtype=np.float64)
    size = np.array(value("size"), dtype=np.float64)
    return Visual(which == "site", index, int(value("type")), size, asset, rgba, material, int(value("group")))


def look_of(model: Any, visual: Visual) -> Look:
    """Look of a visual's material; roughness is derived from MuJoCo's shininess where the material gives none."""
    red, green, blue = (float(x) for x in visual.color)
    rgb = red, green, blue
    material = visual.material
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


def texture_pixels(model: Any, texture: int) -> NDArray[np.uint8]:
    """Pixels of a model's texture, uint8 [height, width, 3], top row first."""
    height, width, channels = (int(n[texture]) for n in (model.tex_height, model.tex_width, model.tex_nchannel))
    start = int(model.tex_adr[texture])
    pixels = np.asarray(model.tex_data[start : start + height * width * channels]).reshape(height, width, channels)
    return np.ascontiguousarray(
        np.repeat(pixels[..., :1], 3, axis=2) if channels < 3 else pixels[..., :3], dtype=np.uint8
    )
