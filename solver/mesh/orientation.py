"""Triangles wound alike: outward where a part is closed, as most of them were where it is open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .corners import Corners
from .counting import counted
from .topology import sides_of
from .winding import labels, turned

# A part that encloses less, relative to its area, has no inside.
_FLAT = 1e-12


def oriented(V: NDArray[np.float64], corners: Corners) -> tuple[Corners, list[str]]:
    """Wind the triangles of a manifold, orientable surface alike, part by part, and say what was turned.

    A closed part faces outwards, wherever it lies; an open one, and one without volume, as most of its triangles did.
    """
    F = corners.F
    pairs, rim = sides_of(F)
    part = labels(pairs // 3, len(F))
    count = int(part.max()) + 1
    start = F.ravel()
    flip = turned(pairs // 3, start[pairs[:, 0]] == start[pairs[:, 1]], len(F))
    volume, area = part_volumes(V, np.where(flip[:, None], F[:, ::-1], F), part)
    closed = np.bincount(part[rim // 3], minlength=count) == 0
    sizes, turns = np.bincount(part), np.bincount(part, weights=flip)
    solid = closed & (np.abs(volume) > _FLAT * area**1.5)
    over = np.where(solid, volume < 0, 2 * turns > sizes)
    flip ^= over[part]
    whole = np.bincount(part, weights=flip, minlength=count) == sizes
    some = int((flip & ~whole[part]).sum())
    notes = []
    if whole.any():
        which = "" if count == 1 else f"{int(whole.sum()):,} of {counted(count, 'part')} "
        notes.append(f"{which}turned inside out (the triangles faced inwards)")
    if some:
        notes.append(f"{counted(some, 'triangle')} reversed (inconsistent winding)")
    return (corners.reversed(flip) if flip.any() else corners), notes


def part_volumes(
    V: NDArray[np.float64], F: NDArray[np.int64], part: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Signed volume of every part [m^3], exact where it is closed, and its area [m^2].

    Parameters
    ----------
    V, F : [vertex_count, 3], [triangle_count, 3]
    part : [triangle_count]
        Part of every triangle, numbered from 0.
    """
    count, size = int(part.max()) + 1, np.bincount(part)
    corners = V[F]
    middle = np.stack([np.bincount(part, weights=x) / size for x in corners.mean(axis=1).T], axis=1)
    a, b, c = np.moveaxis(corners - middle[part][:, None], 1, 0)
    volume = np.bincount(part, weights=np.einsum("ij,ij->i", a, np.cross(b, c)), minlength=count) / 6
    area = np.bincount(part, weights=np.linalg.norm(np.cross(b - a, c - a), axis=1), minlength=count) / 2
    return volume, area
