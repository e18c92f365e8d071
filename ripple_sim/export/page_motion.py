"""The vertices of a surface that moves, as the page streams them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh

from .coding import packed, parents_of, quantised, residuals
from .moving_mesh import MovingMesh
from .ordering import local_order

_STEP = 2e-5  # of places, in sizes of the mesh


class Motion:
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
