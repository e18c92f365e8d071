"""The bodies near the camera's focus as capsules: what shades its neighbours where they come close."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.resources import OwnedObjects

_MOST = 16


class Occluders:
    """Capsules of about each geom's size."""

    def __init__(self, ctx: OwnedObjects, model: Any, geoms: NDArray[np.int64]) -> None:
        self._geoms = geoms
        self._centre, self._half_axis, self._radius = _capsules(model, geoms)
        self._bounds = np.linalg.norm(model.geom_aabb[geoms, 3:], axis=1)
        self._buffer = ctx.buffer(reserve=32 * _MOST, dynamic=True)

    def balls(self, data: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bounding balls of the bodies: centres [k, 3] and radii [k], in metres."""
        return self._middles(data)[1], self._bounds

    def bind(self, data: Any, focus: NDArray[np.float64]) -> int:
        """Bind the capsules nearest to a point; return how many there are."""
        rotation, middle = self._middles(data)
        axis = np.einsum("gij,gj->gi", rotation, self._half_axis)
        away = np.linalg.norm(middle - focus, axis=1)
        nearest = np.argsort(away, kind="stable")
        # whichever leaves the list next has faded away before
        limit = away[nearest[_MOST]] if len(nearest) > _MOST else np.inf
        nearest = nearest[:_MOST]
        fade = np.clip(4 * (1 - away[nearest] / limit), 0.0, 1.0)
        packed = np.zeros((len(nearest), 2, 4), dtype=np.float32)
        packed[:, 0, :3] = (middle - axis)[nearest]
        packed[:, 1, :3] = (middle + axis)[nearest]
        packed[:, 0, 3] = self._radius[nearest] * fade
        packed[:, 1, 3] = self._geoms[nearest]
        self._buffer.write(packed.tobytes())
        self._buffer.bind_to_storage_buffer(4)
        return len(nearest)

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
