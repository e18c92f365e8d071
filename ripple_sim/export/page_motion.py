"""Heights and moving vertices of a page in few bytes: predicted from earlier ones and the frame before, and deflated.

Triangles and vertices come in an order in which neighbours are close together: drawing then computes a vertex about
once and not once for each of its triangles, and heights are predicted well from earlier ones.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh

from .moving_mesh import MovingMesh

_LARGEST = 1 << 20


def parents_of(F: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Two earlier vertices from which each vertex is predicted, [count, 2]; -1 without.

    They are the other two of the first triangle in which it is the last, or else twice the first of the first triangle
    in which it is the second. decode.js finds the same ones.
    """
    ordered = np.sort(F, axis=1)
    parents = np.full((count, 2), -1)
    vertices, first = np.unique(ordered[:, 1], return_index=True)
    parents[vertices] = ordered[first, :1]
    vertices, first = np.unique(ordered[:, 2], return_index=True)
    parents[vertices] = ordered[first, :2]
    return parents


def quantised(heights: NDArray[np.float32], step: float) -> NDArray[np.int64]:
    """Heights [n] in whole steps [m]."""
    return np.clip(np.rint(heights / step), -_LARGEST, _LARGEST).astype(np.int64)


def residuals(now: NDArray[np.int64], before: NDArray[np.int64], parents: NDArray[np.int64]) -> bytes:
    """What is left of the steps [n] since the frame before after prediction: low bytes of all, then high bytes."""
    change = np.append(now - before, 0)  # -1: no parent, no change
    left = change[:-1] - (change[parents[:, 0]] + change[parents[:, 1]] >> 1)
    zigzag = np.where(left < 0, -2 * left - 1, 2 * left).astype("<u4")
    # the prediction's error may take 23 bits
    return b"".join((zigzag >> shift & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))


def packed(content: bytes) -> str:
    """Deflated bytes as text."""
    return base64.b64encode(zlib.compress(content, 9)).decode()


_Ints = NDArray[np.int64]
_BITS = 10  # of a place along each axis


def local_order(
    points: NDArray, F: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles along Morton's curve through their centres, and vertices in the order of their first use.

    Parameters
    ----------
    points : float, shape [n, 3]
    F : int64, shape [m, 3]

    Returns
    -------
    triangles : int64 [m]
        The old numbers of the triangles, in their new order.
    vertices : int64 [n]
        Likewise those of the vertices; unused ones come last.
    renumbered : int64 [m, 3]
        The triangles in their new order, of new vertices.
    """
    triangles = np.argsort(_morton(points[F].mean(axis=1)), kind="stable")
    used, first = np.unique(F[triangles].ravel(), return_index=True)
    vertices = np.concatenate([used[np.argsort(first)], np.setdiff1d(np.arange(len(points)), used)])
    number = np.empty(len(points), np.int64)
    number[vertices] = np.arange(len(points))
    return triangles, vertices, number[F[triangles]]


def _morton(points: NDArray) -> NDArray[np.int64]:
    """Place of points along the curve: the bits of their coordinates, interleaved."""
    low, size = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-30)
    cells = ((points - low) / size * (2**_BITS - 1)).astype(np.int64)
    bits = cells[:, :, None] >> np.arange(_BITS) & 1
    return (bits << 3 * np.arange(_BITS) + np.arange(3)[:, None]).sum(axis=(1, 2))


_STEP = 2e-5  # of places, in sizes of the mesh


class PageMotion:
    """The vertices of a target's own mesh over time; nothing is written of one that rests.

    Parameters
    ----------
    mesh : Mesh
        At rest.
    surface : MovingMesh
        The finer surface, which follows it.
    points : int64 [n]
        Which of its points the page has, in the page's order.
    """

    def __init__(self, mesh: Mesh, surface: MovingMesh, points: NDArray[np.int64]) -> None:
        self._rest, self._surface, self._points = mesh.V, surface, points
        _, self._order, self._F = local_order(mesh.V, mesh.F)
        self._parents = parents_of(self._F, len(mesh.V))
        self._step = _STEP * float(np.ptp(mesh.V, axis=0).max())
        self._frames: list[NDArray[np.float64]] = []
        self.moves = False

    def add(self, V: NDArray[np.float64] | None) -> None:
        """Add a frame, with the vertices at V [m], or at rest."""
        self.moves = self.moves or V is not None
        self._frames.append(self._rest if V is None else np.array(V))

    def told(self) -> dict[str, Any]:
        """The mesh at rest, and how the page's points ride on it."""
        corners, weights, off, *_ = self._surface.riding
        number = np.empty(len(self._order), np.int64)
        number[self._order] = np.arange(len(self._order))
        far = max(float(np.abs(off).max()), 1e-30)
        arrays = [
            self._rest[self._order].astype("<f4"),
            self._F.astype("<u4"),
            number[corners[self._points]].astype("<u4"),
            np.rint(weights[self._points, :2] * 65535).astype("<u2"),
            np.rint(off[self._points] / far * 32767).astype("<i2"),
        ]
        counts = {"points": len(self._order), "triangles": len(self._F)}
        return {**counts, "step": self._step, "far": far, "arrays": packed(b"".join(each.tobytes() for each in arrays))}

    def chunk(self) -> tuple[list[list[float]], bytes]:
        """Middles [m] and coded vertices of the frames since the last chunk, both empty if the surface never moved."""
        middles, planes, frames = [], [], self._frames
        before = np.zeros((3, len(self._order)), np.int64)  # a chunk can be decoded alone
        self._frames = []
        for V in frames if self.moves else ():
            middle = np.round(V.mean(axis=0), 6)
            steps = quantised((V - middle)[self._order].T, self._step)
            planes += [residuals(now, last, self._parents) for now, last in zip(steps, before, strict=True)]
            middles.append(middle.tolist())
            before = steps
        return middles, b"".join(planes)
