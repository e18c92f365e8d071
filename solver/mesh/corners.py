"""Triangles on their way through cleaning, with what belongs to each of their corners."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray


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
        parent, corner = _pieces(point >= 0)
        columns = np.arange(3)
        F, numbers = np.hstack([self.F, point]), np.hstack([self.given, given])
        uv = None
        if self.uv is not None:
            along = self.uv + share[..., None] * (self.uv[:, (columns + 1) % 3] - self.uv)
            uv = np.concatenate([self.uv, along], axis=1)[parent[:, None], corner]
        return Corners(F[parent[:, None], corner], numbers[parent[:, None], corner], uv)


def _pieces(cut: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangle of which each piece is a part, and its corners: 0 to 2 those of the triangle, 3 to 5 points on sides."""
    parents, corners = [], []
    for code in range(8):
        chosen = np.flatnonzero(cut @ [1, 2, 4] == code)
        pattern = _PATTERNS[code]
        parents.append(np.repeat(chosen, len(pattern)))
        corners.append(np.tile(pattern, (len(chosen), 1)))
    parent, corner = np.concatenate(parents), np.concatenate(corners)
    order = np.argsort(parent, kind="stable")
    return parent[order], corner[order]


def _turned(pattern: list[list[int]], k: int) -> list[list[int]]:
    """The pattern for a triangle that is turned by k corners."""
    return [[(x + k) % 3 + 3 * (x >= 3) for x in piece] for piece in pattern]


_ONE = [[0, 3, 2], [3, 1, 2]]  # side 0 is cut
_TWO = [[3, 1, 4], [0, 3, 4], [0, 4, 2]]  # sides 0 and 1
_PATTERNS = {
    0: [[0, 1, 2]],
    **{1 << k: _turned(_ONE, k) for k in range(3)},
    **{(1 << k) + (1 << (k + 1) % 3): _turned(_TWO, k) for k in range(3)},
    7: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
}
