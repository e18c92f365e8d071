"""Triangles on their way through cleaning, with what belongs to each of their corners, and wound alike."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .topology import labels, sides_of, split_triangles, turned


@dataclasses.dataclass(frozen=True)
class Corners:
    """What belongs to the corners of triangles; side k of a triangle runs from corner k to corner k + 1.

    Attributes
    ----------
    F : int64 [triangle_count, 3]
        Vertex, equal positions being one vertex.
    given : int64 [triangle_count, 3]
        Vertex as it was given: at places where surfaces touch, it tells which triangles were joined.
    uv : float64 [triangle_count, 3, 2] or None
        Texture coordinates.
    """

    F: NDArray[np.int64]
    given: NDArray[np.int64]
    uv: NDArray[np.float64] | None

    def kept(self, keep: NDArray) -> Corners:
        """Some of the triangles, chosen by a mask or by number."""
        return Corners(self.F[keep], self.given[keep], None if self.uv is None else self.uv[keep])

    def reversed(self, which: NDArray[np.bool_]) -> Corners:
        """The same triangles, those chosen wound the other way."""
        F, given = (np.where(which[:, None], x[:, ::-1], x) for x in (self.F, self.given))
        return Corners(F, given, None if self.uv is None else np.where(which[:, None, None], self.uv[:, ::-1], self.uv))

    def split(self, point: NDArray[np.int64], given: NDArray[np.int64], share: NDArray[np.float64]) -> Corners:
        """Insert vertices into sides, and cut the triangles there. They keep their order, area and winding.

        Parameters
        ----------
        point, given : [triangle_count, 3]
            Vertex to be inserted into each side, and its number as given; -1 where there is none.
        share : [triangle_count, 3]
            Where it lies, from 0 at the side's first corner to 1 at the other.
        """
        parent, corner = split_triangles(point >= 0)
        columns = np.arange(3)
        F, numbers = np.hstack([self.F, point]), np.hstack([self.given, given])
        uv = None
        if self.uv is not None:
            along = self.uv + share[..., None] * (self.uv[:, (columns + 1) % 3] - self.uv)
            uv = np.concatenate([self.uv, along], axis=1)[parent[:, None], corner]
        return Corners(F[parent[:, None], corner], numbers[parent[:, None], corner], uv)


_PLURALS = {"vertex": "vertices"}


def counted(number: int, thing: str) -> str:
    """A number and its noun: 1 edge, 2 edges, 1,000 vertices."""
    *words, noun = thing.split()
    return " ".join([f"{number:,}", *words, noun if number == 1 else _PLURALS.get(noun, noun + "s")])


def place(point: NDArray[np.float64]) -> str:
    """A point in brackets, to four digits."""
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


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
