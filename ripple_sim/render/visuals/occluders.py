"""Ambient occlusion between geoms: those near the camera's focus, approximated by capsules."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import Balls
from ripple_sim.render.contract import MAX_OCCLUDERS, Binding
from ripple_sim.render.resources import Resources

_REACH = 9.5  # in radii: what is further hides less than a hundredth of the sky


class Occluders:
    """Capsules of about each geom's size.

    Parameters
    ----------
    resources : Resources
    model : mujoco.MjModel
    geoms : int64 [k]
    """

    def __init__(self, resources: Resources, model: Any, geoms: NDArray[np.int64]) -> None:
        self._geoms = geoms
        self._centre, self._half_axis, self._radius = _capsules(model, geoms)
        self._bounds = np.linalg.norm(model.geom_aabb[geoms, 3:], axis=1)
        self._buffer = resources.buffer(reserve=32 * MAX_OCCLUDERS, dynamic=True)
        self._bound, self._bound_geoms = np.zeros((0, 2, 4)), np.zeros(0, np.int64)

    def balls(self, data: Any) -> Balls:
        """Bounding balls of the geoms."""
        return Balls(self._middles(data)[1], self._bounds)

    def bind(self, data: Any, focus: NDArray[np.float64]) -> None:
        """Bind the capsules nearest to a point [m]."""
        rotation, middle = self._middles(data)
        axis = np.einsum("gij,gj->gi", rotation, self._half_axis)
        away = np.linalg.norm(middle - focus, axis=1)
        nearest = np.argsort(away, kind="stable")
        # capsules fade out before they leave the list
        limit = away[nearest[MAX_OCCLUDERS]] if len(nearest) > MAX_OCCLUDERS else np.inf
        nearest = nearest[:MAX_OCCLUDERS]
        fade = np.clip(4 * (1 - away[nearest] / limit), 0.0, 1.0)
        packed = np.zeros((len(nearest), 2, 4), dtype=np.float32)
        packed[:, 0, :3] = (middle - axis)[nearest]
        packed[:, 1, :3] = (middle + axis)[nearest]
        packed[:, 0, 3] = self._radius[nearest] * fade
        self._buffer.write(packed.tobytes())
        self._buffer.bind_to_uniform_block(Binding.OCCLUDERS)
        self._bound, self._bound_geoms = packed.astype(np.float64), self._geoms[nearest]

    def near(self, balls: Balls, geoms: NDArray[np.int64]) -> NDArray[np.int64]:
        """Which of the bound capsules darken objects by a hundredth or more, as bits; never an object's own.

        Parameters
        ----------
        balls : Balls
            k of them, which contain the objects.
        geoms : int64 [k]
            The objects' own.
        """
        first, last, radius = self._bound[:, 0, :3], self._bound[:, 1, :3], self._bound[:, 0, 3]
        axis, to = last - first, balls.centres[:, None] - first
        along = np.einsum("ej,kej->ke", axis, to) / np.maximum(np.einsum("ej,ej->e", axis, axis), 1e-12)
        away = np.linalg.norm(to - np.clip(along, 0, 1)[..., None] * axis, axis=2) - balls.radii[:, None]
        counts = (away < _REACH * radius) & (geoms[:, None] != self._bound_geoms)
        return (counts << np.arange(len(radius))).sum(axis=1)

    def _middles(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rotation = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        return rotation, data.geom_xpos[self._geoms] + np.einsum("gij,gj->gi", rotation, self._centre)


def _capsules(model: Any, geoms: NDArray[np.int64]) -> tuple[NDArray, NDArray, NDArray]:
    """Centre, half axis and radius of a capsule of about each geom's size, in its frame."""
    centre, half_axis, radius = np.zeros((len(geoms), 3)), np.zeros((len(geoms), 3)), np.zeros(len(geoms))
    for index, geom in enumerate(geoms):
        half = np.asarray(model.geom_aabb[geom][3:], dtype=np.float64)
        centre[index] = model.geom_aabb[geom][:3]
        longest = int(np.argmax(half))
        radius[index] = np.sqrt(np.prod(np.delete(half, longest)))
        half_axis[index, longest] = max(half[longest] - radius[index], 0.0)
    return centre, half_axis, radius
