"""Rims of an open surface: what holds them, where they lie beside texels, and how they pull at a stretched surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError, shown
from ..kernel import Floats, Ints
from ..texels.texel_mesh import TexelMesh

# Waves come back upright from a free rim, inverted from one that is held. "fixed": heights and, of
# a plate, L h are 0.
RIMS = ("free", "supported", "clamped", "fixed")

FREE = 1
SUPPORTED = 2
CLAMPED = 3

# A name for all of the rim, or a function of its points [k, 3]: a name for each, or whether it is
# clamped, else free.
Rim: TypeAlias = str | Callable[[NDArray[np.float64]], ArrayLike]

# Places next to a texel, beyond each side of a chart: slices of the halo, and of the texels along
# it.
_SIDES = (
    (np.s_[:, 0, 1:-1], np.s_[:, 0]),
    (np.s_[:, 1:-1, -1], np.s_[:, :, -1]),
    (np.s_[:, -1, 1:-1], np.s_[:, -1]),
    (np.s_[:, 1:-1, 0], np.s_[:, :, 0]),
)


def rim_conditions(texels: TexelMesh, rim: Rim) -> NDArray[np.int8]:
    """What each place beyond a rim is, [C, n + 2, n + 2]: `FREE`, `SUPPORTED` or `CLAMPED`; 0 elsewhere.

    Raises
    ------
    SolverError
        For an unknown name, or a function whose result is neither a name nor a bool for each point.
    """
    valid = f"valid are {', '.join(map(repr, RIMS))}"
    conditions = np.zeros(texels.topology.halo.shape, np.int8)
    at = texels.topology.rim
    if isinstance(rim, str):
        if rim not in RIMS:
            raise SolverError(f"rim {rim!r} does not exist; {valid}")
        conditions[at] = RIMS.index(rim) + 1 if rim != "fixed" else SUPPORTED
        return conditions
    if not callable(rim):
        raise SolverError(
            f"rim {shown(rim)} is no name; {valid}, or a function of points [k, 3] that gives them"
        )
    points = texels.halo_positions[at]
    points = np.where(
        np.isfinite(points), points, texels.positions.reshape(-1, 3)[texels.topology.halo[at]]
    )
    found = np.asarray(rim(points))
    if found.shape != (len(points),) or found.dtype.kind not in "bU":
        raise SolverError(
            f"the function of the rim gives {found.dtype} of shape {found.shape} for {len(points)} "
            f"points; valid are "
            "a name or a bool for each: 'free', 'supported' or 'clamped', or whether it is clamped"
        )
    if found.dtype.kind == "b":
        found = np.where(found, "clamped", "free")
    wrong = found[~np.isin(found, RIMS[:3])]
    if len(wrong):
        raise SolverError(
            f"the function of the rim gives {str(wrong[0])!r}; valid are 'free', 'supported', "
            f"'clamped'"
        )
    conditions[at] = sum((k + 1) * (found == name) for k, name in enumerate(RIMS[:3]))
    return conditions


class RimPlaces(NamedTuple):
    """Places beside texels, beyond a rim, k of them.

    Attributes
    ----------
    texels : int64 [k]
        Flat index of the texel beside.
    conditions : int8 [k]
    points : float64 [k, 3]
        On the rim [m]; the texel's own centre where the surface ends in it.
    lengths : float64 [k]
        Of the rim that belongs to the place [m].
    """

    texels: Ints
    conditions: NDArray[np.int8]
    points: Floats
    lengths: Floats


def rim_places(texels: TexelMesh, conditions: NDArray[np.int8]) -> RimPlaces:
    """The places where texels lie beside a rim."""
    topology = texels.topology
    around = texels.halo_positions
    found = []
    for outside, inside in _SIDES:
        at = conditions[outside] > 0
        points = np.where(np.isfinite(around[outside]), around[outside], texels.positions[inside])
        # ends of a side count one-sided
        along = np.concatenate([points[:, :1], points, points[:, -1:]], axis=1)
        lengths = np.linalg.norm(along[:, 2:] - along[:, :-2], axis=-1)
        lengths[:, 1:-1] /= 2
        found.append((topology.halo[outside][at], conditions[outside][at], points[at], lengths[at]))
    return RimPlaces(*(np.concatenate(each) for each in zip(*found, strict=True)))


def tension_springs(places: RimPlaces, texels: TexelMesh, tension: Floats) -> Floats:
    """Springs by which a stretched surface is tied to the rims that hold it [N/m], [T]; `tension` [N/m] is [T]."""
    way = np.linalg.norm(places.points - texels.positions.reshape(-1, 3)[places.texels], axis=1)
    way[(places.conditions == FREE) | (way == 0)] = np.inf
    pull = tension[places.texels] * places.lengths / way
    return np.bincount(places.texels, pull, len(tension)).astype(np.float64)
