"""The connected parts of a mesh: which of them carry waves, and which have the same shape.

A part smaller than a few texels shows no wave, charts for thousands of crumbs would take minutes,
and the tiny texels on them would shorten the time step of all. Such parts lie still. Parts of the
same shape, such as the screws of a machine, are cut into charts once.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ...kernel import Bools, Floats, Ints
from ...mesh.topology import labels, triangle_areas
from .surface import TriangleSurface

# Parts that carry waves, at most: the largest ones. Each has charts of its own.
MAX_PARTS = 1000

# Texels along the side of a chart, at least, in an atlas that would have too many otherwise. For
# the same number of texels, eigenvalues on charts of 2 x 2 are as exact as on larger ones.
MIN_SIDE = 2

# Texels in the area of a part, at least, or it is a crumb. A closed part has 12 charts of 2 x 2
# texels or more: on a crumb, texels would be less than half as wide as elsewhere.
MIN_TEXELS = 12

# Share of the area of a mesh that all its crumbs have together, at most, unless they are smaller
# than a texel each. A heap of small parts still carries waves.
MAX_STILL_SHARE = 0.05

# Difference between the lengths of sides of two parts of the same shape, at most, in units of the
# longest side: above the round-off of a file in float32.
_MAX_LENGTH_DIFFERENCE = 1e-4


@dataclasses.dataclass(frozen=True, eq=False)
class Part:
    """A connected component of a mesh.

    Attributes
    ----------
    surface : TriangleSurface
        Its triangles, with vertices numbered in the order of the mesh.
    faces : int64 [m]
        Their numbers in the mesh, in ascending order.
    share : float
        Share of the area of the mesh.
    """

    surface: TriangleSurface
    faces: Ints
    share: float


@dataclasses.dataclass(frozen=True, eq=False)
class Parts:
    """The parts of a mesh.

    Attributes
    ----------
    waving : list of Part
        Those that carry waves, in the order of their first triangles.
    crumbs : list of int64 [m]
        The triangles of each part that lies still since it is smaller than a few texels.
    surplus : list of int64 [m]
        The triangles of each part that lies still since there are so many larger ones.
    """

    waving: list[Part]
    crumbs: list[Ints]
    surplus: list[Ints]


def parts_of(V: Floats, F: Ints, texels: int | None = None) -> Parts:
    """The connected components of the mesh V [n, 3] [m], F [m, 3].

    Of a mesh with a number of texels, parts smaller than a few texels are crumbs, and the others
    beyond the largest thousand are surplus; without a number there are none of either. The largest
    part carries waves in any case.
    """
    edges = np.stack([F, np.roll(F, -1, axis=1)], axis=-1).reshape(-1, 2)
    part_of = np.unique(labels(edges, len(V))[F[:, 0]], return_inverse=True)[1]
    areas = triangle_areas(V, F)
    shares = np.bincount(part_of, areas / areas.sum()).astype(np.float64)
    order = np.argsort(part_of, kind="stable")
    faces_of_parts = np.split(order, np.cumsum(np.bincount(part_of))[:-1])
    is_crumb = np.zeros(len(shares), bool)
    is_surplus = np.zeros(len(shares), bool)
    if texels is not None:
        is_crumb = (shares < 1 / texels) | smallest(shares, MIN_TEXELS / texels)
        is_crumb[shares.argmax()] = False
        is_surplus[np.argsort(-shares, kind="stable")[MAX_PARTS:]] = True
        is_surplus &= ~is_crumb
    waving = []
    for part in np.flatnonzero(~is_crumb & ~is_surplus).tolist():
        faces = faces_of_parts[part]
        used, corners = np.unique(F[faces], return_inverse=True)
        surface = TriangleSurface.of(V[used], corners.reshape(-1, 3))
        waving.append(Part(dataclasses.replace(surface, parent=faces), faces, float(shares[part])))
    crumbs = [faces_of_parts[part] for part in np.flatnonzero(is_crumb)]
    surplus = [faces_of_parts[part] for part in np.flatnonzero(is_surplus)]
    return Parts(waving, crumbs, surplus)


def smallest(shares: Floats, limit: float) -> Bools:
    """Mask of the parts below a share of the area, smallest first, up to a little in all."""
    ascending = np.argsort(shares, kind="stable")
    is_small = np.zeros(len(shares), bool)
    is_small[ascending] = np.cumsum(shares[ascending]) <= MAX_STILL_SHARE
    return is_small & (shares < limit)


def models_of(parts: list[Part], counts: list[int]) -> list[int]:
    """For each part the first one of the same shape and number of cells: its model.

    Two parts have the same shape if their triangles are numbered alike, and their sides have the
    same lengths, up to one factor.
    """
    models = []
    known: dict[tuple[int, bytes], list[tuple[int, Floats]]] = {}
    for i, part in enumerate(parts):
        lengths = part.surface.edge_lengths / part.surface.edge_lengths.max()
        candidates = known.setdefault((counts[i], part.surface.F.tobytes()), [])
        for model, model_lengths in candidates:
            if np.abs(lengths - model_lengths).max() < _MAX_LENGTH_DIFFERENCE:
                models.append(model)
                break
        else:
            candidates.append((i, lengths))
            models.append(i)
    return models


def transferred(surface: TriangleSurface, model: Part, part: Part) -> TriangleSurface:
    """Triangles cut from a model, on another part of the same shape."""
    local = np.searchsorted(model.faces, surface.parent)
    corners = part.surface.V[part.surface.F[local]]
    V = np.empty_like(surface.V)
    V[surface.F] = np.einsum("fij,fjk->fik", surface.inside, corners)
    return dataclasses.replace(surface, V=V, parent=part.faces[local])
