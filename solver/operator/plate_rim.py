"""Rims of an open surface: their conditions, their places beside texels, and their pull."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError, shown
from ..kernel import Floats, Ints
from ..texels.texel_mesh import TexelMesh

# Names of rims. Waves come back upright from a free rim, inverted from any other. At a "fixed" rim
# heights are 0, and for a plate L h as well.
RIMS = ("free", "supported", "clamped", "fixed")

# Conditions of places on a rim.
FREE = 1
SUPPORTED = 2
CLAMPED = 3

# A name for all of the rim, or a function of its points [k, 3] that gives a name for each point, or
# whether the point is clamped rather than free.
Rim: TypeAlias = str | Callable[[NDArray[np.float64]], ArrayLike]

# The four sides of a chart: the slice of the halo that lies beyond each side, and that of the
# texels along the side.
_SIDES = (
    (np.s_[:, 0, 1:-1], np.s_[:, 0]),
    (np.s_[:, 1:-1, -1], np.s_[:, :, -1]),
    (np.s_[:, -1, 1:-1], np.s_[:, -1]),
    (np.s_[:, 1:-1, 0], np.s_[:, :, 0]),
)


def rim_conditions(texels: TexelMesh, rim: Rim) -> NDArray[np.int8]:
    """Condition of each place beyond a rim, [C, n + 2, n + 2]; 0 elsewhere.

    The conditions are `FREE`, `SUPPORTED` and `CLAMPED`.

    Raises
    ------
    SolverError
        For an unknown name, or a function whose result is neither a name nor a bool for each point.
    """
    valid = ", ".join(map(repr, RIMS))
    conditions = np.zeros(texels.topology.halo.shape, np.int8)
    at = texels.topology.rim
    if isinstance(rim, str):
        if rim not in RIMS:
            raise SolverError(f"rim must be one of {valid}, got {rim!r}")
        conditions[at] = RIMS.index(rim) + 1 if rim != "fixed" else SUPPORTED
        return conditions
    if not callable(rim):
        raise SolverError(
            f"rim must be one of {valid}, or a function of points [k, 3] that returns such names, "
            f"got {shown(rim)}"
        )
    points = texels.halo_positions[at]
    shown_points = texels.positions.reshape(-1, 3)[texels.topology.halo[at]]
    names = _rim_names(rim, np.where(np.isfinite(points), points, shown_points))
    condition_of_point = np.zeros(len(names), np.int8)
    for condition, name in enumerate(RIMS[:3], start=FREE):
        condition_of_point[names == name] = condition
    conditions[at] = condition_of_point
    return conditions


def _rim_names(rim: Callable[[Floats], ArrayLike], points: Floats) -> NDArray[np.str_]:
    """Names in `RIMS` that a user's function gives for points of the rim [k, 3], [k]."""
    names = np.asarray(rim(points))
    if names.shape != (len(points),) or names.dtype.kind not in "bU":
        raise SolverError(
            f"the function of the rim must give a name or a bool for each of {len(points)} "
            "points ('free', 'supported' or 'clamped', or whether it is clamped), got "
            f"{names.dtype} of shape {names.shape}"
        )
    if names.dtype.kind == "b":
        names = np.where(names, "clamped", "free")
    wrong = names[~np.isin(names, RIMS[:3])]
    if len(wrong):
        raise SolverError(
            "the function of the rim must give 'free', 'supported' or 'clamped', got "
            f"{str(wrong[0])!r}"
        )
    return names


class RimPlaces(NamedTuple):
    """Places beside texels, beyond a rim, k of them.

    Attributes
    ----------
    texels : int64 [k]
        Flat index of the texel beside each place.
    conditions : int8 [k]
    points : float64 [k, 3]
        On the rim [m]; the texel's own centre where the surface ends in it.
    lengths : float64 [k]
        Length of the rim that belongs to each place [m].
    """

    texels: Ints
    conditions: NDArray[np.int8]
    points: Floats
    lengths: Floats


def rim_places(texels: TexelMesh, conditions: NDArray[np.int8]) -> RimPlaces:
    """The places where texels lie beside a rim."""
    topology = texels.topology
    around = texels.halo_positions
    sides = []
    for outside, inside in _SIDES:
        at = conditions[outside] > 0
        points = np.where(np.isfinite(around[outside]), around[outside], texels.positions[inside])
        # ends of a side count one-sided
        along = np.concatenate([points[:, :1], points, points[:, -1:]], axis=1)
        lengths = np.linalg.norm(along[:, 2:] - along[:, :-2], axis=-1)
        lengths[:, 1:-1] /= 2
        texels_beside = topology.halo[outside][at]
        sides.append(RimPlaces(texels_beside, conditions[outside][at], points[at], lengths[at]))
    return RimPlaces(
        np.concatenate([side.texels for side in sides]),
        np.concatenate([side.conditions for side in sides]),
        np.concatenate([side.points for side in sides]),
        np.concatenate([side.lengths for side in sides]),
    )


def tension_springs(places: RimPlaces, texels: TexelMesh, tension: Floats) -> Floats:
    """Springs that tie a stretched surface to the rims that hold it [N/m], [T].

    `tension` [T] is in [N/m].
    """
    way = np.linalg.norm(places.points - texels.positions.reshape(-1, 3)[places.texels], axis=1)
    way[(places.conditions == FREE) | (way == 0)] = np.inf
    pull = tension[places.texels] * places.lengths / way
    return np.bincount(places.texels, pull, len(tension)).astype(np.float64)
