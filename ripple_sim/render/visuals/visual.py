"""Visuals: the geoms and sites that a MuJoCo model shows, read alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft_ids import first_flex, first_skin, is_soft
from ripple_sim.render.bounds import Balls
from ripple_sim.render.color import srgb_to_linear

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


def ball_of(model: Any, data: Any, visual: Visual) -> Balls:
    """Bounding ball of a visual in the world; that of a plane is infinite."""
    if visual.site:
        half = visual.half_sizes
        radius = float(np.linalg.norm(half) + half[0])  # a capsule has ends, too
        return Balls(data.site_xpos[visual.index][None], np.array([radius]))
    box, position = model.geom_aabb[visual.index], data.geom_xpos[visual.index]
    if visual.kind == _GEOM.mjGEOM_PLANE:
        return Balls(position[None], np.array([np.inf]))
    centre = position + data.geom_xmat[visual.index].reshape(3, 3) @ box[:3]
    return Balls(centre[None], np.array([float(np.linalg.norm(box[3:]))]))


def _visual(model: Any, which: str, index: int, asset: int) -> Visual:
    def value(name: str) -> Any:
        return getattr(model, f"{which}_{name}")[index]

    rgba, material = np.array(value("rgba"), dtype=np.float64), int(value("matid"))
    if material >= 0 and np.array_equal(rgba, _UNSET):
        rgba = np.array(model.mat_rgba[material], dtype=np.float64)
    size = np.array(value("size"), dtype=np.float64)
    return Visual(which == "site", index, int(value("type")), size, asset, rgba, material, int(value("group")))
