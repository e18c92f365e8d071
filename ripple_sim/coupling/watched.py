"""Arrays of a model that its user may write to at any time, compared before each frame or step.

Comparing a large array takes no longer than comparing a small one: of a large array only samples
are compared, and one stretch after another completely.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from .ids import TargetId, is_geom

# Arrays up to this size are compared completely each time, in some 0.05 ms [bytes].
_MAX_WHOLE_SIZE = 1 << 20

# Length of the stretch of a larger array that is compared each time, one after another [bytes].
_STRETCH = 1 << 18

# Number of samples of a larger array that are compared each time.
_SAMPLES = 4096


def _bytes_of(array: NDArray) -> NDArray[np.uint8]:
    """The bytes of a contiguous array, not copied."""
    return array.reshape(-1).view(np.uint8)


class WatchedArray:
    """Tells whether an array was written to; it must be contiguous."""

    def __init__(self, array: NDArray) -> None:
        self._stretch_start = 0  # of the next stretch [bytes]
        self.take(array)

    def take(self, array: NDArray) -> None:
        """Remember the array as it is now."""
        self._remembered = _bytes_of(array).copy()
        self._sample_distance = max(len(self._remembered) // _SAMPLES, 1)  # [bytes]

    def changed(self, array: NDArray) -> bool:
        """Whether the array differs from the remembered one, as far as it is compared.

        An array of at most 1 MiB is compared completely. A larger one is compared at samples, and
        over the next stretch.
        """
        current = _bytes_of(array)
        remembered = self._remembered
        if len(current) <= _MAX_WHOLE_SIZE:
            return not np.array_equal(current, remembered)
        stretch = slice(self._stretch_start, self._stretch_start + _STRETCH)
        self._stretch_start = stretch.stop if stretch.stop < len(current) else 0
        if not np.array_equal(current[stretch], remembered[stretch]):
            return True
        samples = np.s_[:: self._sample_distance]
        return not np.array_equal(current[samples], remembered[samples])

    def differs(self, array: NDArray, start: int, count: int) -> bool:
        """Whether `count` bytes from the byte `start` on differ from the remembered ones."""
        span = slice(start, start + count)
        return not np.array_equal(_bytes_of(array)[span], self._remembered[span])


class WatchedShape:
    """Tells whether a geom's surface was changed in the model: its size, height field or mesh.

    Parameters
    ----------
    model : mujoco.MjModel
    target : TargetId
        The shape of a flex or a skin never changes.
    """

    def __init__(self, model: mujoco.MjModel, target: TargetId) -> None:
        self._target = target
        self._watched = [WatchedArray(array) for array in self._arrays(model)]

    def changed(self, model: mujoco.MjModel) -> bool:
        """Whether the surface differs from the one at the beginning."""
        return any(
            watched.changed(array)
            for watched, array in zip(self._watched, self._arrays(model), strict=True)
        )

    def _arrays(self, model: mujoco.MjModel) -> list[NDArray]:
        """The arrays that describe the surface."""
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
