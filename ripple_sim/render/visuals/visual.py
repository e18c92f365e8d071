"""What a MuJoCo model shows: its geoms and its sites, read alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.color import linear

_GEOM = mujoco.mjtGeom
_VISIBLE_GROUPS = 3  # MuJoCo shows groups 0 to 2 by default
_UNSET = [0.5, 0.5, 0.5, 1.0]  # a geom's or site's colour where the MJCF gives none


@dataclass(frozen=True, eq=False)
class Piece:
    """A geom or a site.

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
        sRGB and opacity: its own, or its material's where it has none of its own.
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
        """Whether MuJoCo shows it by default: of groups 0 to 2, and not wholly transparent."""
        return self.group < _VISIBLE_GROUPS and self.opacity > 0.0

    @property
    def color(self) -> NDArray[np.float64]:
        """Linear colour, shape [3]."""
        return linear(self.rgba[:3])

    @property
    def opacity(self) -> float:
        """0 to 1."""
        return float(self.rgba[3])

    @property
    def half_sizes(self) -> NDArray[np.float64]:
        """Half sizes of a primitive along its axes [m], a capsule's without its ends; 0 where a plane has no end."""
        match self.kind:
            case _GEOM.mjGEOM_SPHERE:
                return np.full(3, self.size[0])
            case _GEOM.mjGEOM_CAPSULE | _GEOM.mjGEOM_CYLINDER:
                return self.size[[0, 0, 1]]
            case _:
                return self.size


def geom_piece(model: Any, geom: int) -> Piece:
    """Geom of a model."""
    return _piece(model, "geom", geom, int(model.geom_dataid[geom]))


def site_piece(model: Any, site: int) -> Piece:
    """Site of a model."""
    return _piece(model, "site", site, -1)


def visible_geoms(model: Any) -> list[int]:
    """Ids of the geoms that MuJoCo shows by default."""
    return [geom for geom in range(model.ngeom) if geom_piece(model, geom).visible]


def visible_sites(model: Any) -> list[int]:
    """Ids of the sites that MuJoCo shows by default."""
    return [site for site in range(model.nsite) if site_piece(model, site).visible]


def host_of(model: Any, piece: Piece) -> int:
    """Geom that a piece belongs to: itself, or the geom of the site's body whose middle is nearest; -1 without."""
    if not piece.site:
        return piece.index
    near = np.flatnonzero(model.geom_bodyid == model.site_bodyid[piece.index])
    if not len(near):
        return -1
    return int(near[np.argmin(np.linalg.norm(model.geom_pos[near] - model.site_pos[piece.index], axis=1))])


def ball_of(model: Any, data: Any, piece: Piece) -> tuple[NDArray[np.float64], float]:
    """Bounding ball of a piece in the world: centre [3] and radius, in metres; that of a plane has no end."""
    if piece.site:
        half = piece.half_sizes
        return data.site_xpos[piece.index], float(np.linalg.norm(half) + half[0])  # a capsule has ends, too
    box, position = model.geom_aabb[piece.index], data.geom_xpos[piece.index]
    if piece.kind == _GEOM.mjGEOM_PLANE:
        return position, np.inf
    return position + data.geom_xmat[piece.index].reshape(3, 3) @ box[:3], float(np.linalg.norm(box[3:]))


def _piece(model: Any, which: str, index: int, asset: int) -> Piece:
    def value(name: str) -> Any:
        return getattr(model, f"{which}_{name}")[index]

    rgba, material = np.array(value("rgba"), dtype=np.float64), int(value("matid"))
    if material >= 0 and np.array_equal(rgba, _UNSET):
        rgba = np.array(model.mat_rgba[material], dtype=np.float64)
    size = np.array(value("size"), dtype=np.float64)
    return Piece(which == "site", index, int(value("type")), size, asset, rgba, material, int(value("group")))
