"""Arrays of a model that its user may write to at any time, looked at before each frame or step.

A look at a large array costs no more than one at a small one: samples of all of it are compared,
and one stretch after another whole.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from .ids import TargetId, is_geom

# Arrays up to this size are compared whole at each look, in some 0.05 ms [bytes].
_MAX_WHOLE_SIZE = 1 << 20

# Length of the stretch of a larger array that is compared at each look, one after another [bytes].
_STRETCH = 1 << 18

# Samples of a larger array that are compared at each look.
_SAMPLES = 4096


def _bytes_of(array: NDArray) -> NDArray[np.uint8]:
    """The bytes of a contiguous array, not copied."""
    return array.reshape(-1).view(np.uint8)


class WatchedArray:
    """Tells whether an array was written to; it must be contiguous."""

    def __init__(self, array: NDArray) -> None:
        # where the next stretch begins [bytes]
        self._next = 0
        self.take(array)

    def take(self, array: NDArray) -> None:
        """Remember the array as it is now."""
        self._taken = _bytes_of(array).copy()
        self._step = max(len(self._taken) // _SAMPLES, 1)

    def changed(self, array: NDArray) -> bool:
        """Whether the array differs from the remembered one, as far as this look goes.

        An array of at most 1 MiB is compared whole. A larger one is compared at samples of all of
        it, and over the next stretch.
        """
        now = _bytes_of(array)
        taken = self._taken
        if len(now) <= _MAX_WHOLE_SIZE:
            return not np.array_equal(now, taken)
        stretch = slice(self._next, self._next + _STRETCH)
        self._next = stretch.stop if stretch.stop < len(now) else 0
        if not np.array_equal(now[stretch], taken[stretch]):
            return True
        return not np.array_equal(now[:: self._step], taken[:: self._step])

    def differs(self, array: NDArray, start: int, count: int) -> bool:
        """Whether `count` bytes from the byte `start` on differ from the remembered ones."""
        part = slice(start, start + count)
        return not np.array_equal(_bytes_of(array)[part], self._taken[part])


class WatchedShape:
    """Tells whether a program has given a geom another surface: another size, height field or mesh.

    Parameters
    ----------
    model : mujoco.MjModel
    target : TargetId
        What is soft has no shape of its own, and never changes.
    """

    def __init__(self, model: mujoco.MjModel, target: TargetId) -> None:
        self._target = target
        self._watched = [WatchedArray(array) for array in self._arrays(model)]

    def changed(self, model: mujoco.MjModel) -> bool:
        """Whether the surface is another one than at the beginning."""
        return any(
            watched.changed(array)
            for watched, array in zip(self._watched, self._arrays(model), strict=True)
        )

    def _arrays(self, model: mujoco.MjModel) -> list[NDArray]:
        """The arrays that say what the surface is."""
        geom = self._target
        if not is_geom(geom, model):
            return []
        asset = int(model.geom_dataid[geom])
        match int(model.geom_type[geom]):
            case mujoco.mjtGeom.mjGEOM_HFIELD:
                first = int(model.hfield_adr[asset])
                count = int(model.hfield_nrow[asset] * model.hfield_ncol[asset])
                return [model.hfield_data[first : first + count], model.hfield_size[asset]]
            case mujoco.mjtGeom.mjGEOM_MESH | mujoco.mjtGeom.mjGEOM_SDF:
                first = int(model.mesh_vertadr[asset])
                count = int(model.mesh_vertnum[asset])
                return [model.mesh_vert[first : first + count]]
            case _:
                return [model.geom_size[geom]]
