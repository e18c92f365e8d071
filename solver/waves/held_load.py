"""The load of the coming steps: forces held until further notice, and those of a single step."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..backends.backend import Backend
from ..errors import SolverError
from .load import Load

Counterpart: TypeAlias = Callable[[NDArray[np.int64], NDArray[np.float64]], "float | NDArray[np.float64]"]


class HeldLoad:
    """Forces that a backend holds over its steps.

    Parameters
    ----------
    backend : Backend
    share : float64 [C, n, n]
        Of a force that sets a texel in motion.
    """

    def __init__(self, backend: Backend, share: NDArray[np.float64]) -> None:
        self._backend = backend
        self._shape = share.shape
        self._share = share.reshape(-1)
        self._size = share.size
        self._held = Load.none()
        self._uploaded = self._held

    def forces(self) -> NDArray[np.float64]:
        """Forces held at every texel [N], positive inwards, [C, n, n]."""
        forces = np.bincount(self._held.texels, self._held.forces, self._size).astype(np.float64, copy=False)
        return forces.reshape(self._shape)

    @property
    def load(self) -> Load:
        """What is held; assign to change it."""
        return self._held

    @load.setter
    def load(self, load: Load) -> None:
        self._held = load

    def add(self, load: Load) -> None:
        """Hold a load beside what is held."""
        self._held = Load.together([self._held, load]).merged(self._size)

    def upload(self, extra: Load | None, counterpart: Counterpart) -> float | None:
        """Hand the backend the load of the coming step, with `extra` for that step alone, unless it has it already.

        Parameters
        ----------
        extra : Load or None
        counterpart : callable
            From texels and the forces on them, outwards [N], to the acceleration that balances them; see
            `VolumeBalance.counterpart`.

        Returns
        -------
        float or None
            Sum of a new load's forces [N], positive inwards.

        Raises
        ------
        SolverError
            If the forces are not finite, or a texel does not exist.
        """
        load = self._held if extra is None else Load.together([self._held, extra])
        if load is self._uploaded or not (len(load.texels) or len(self._uploaded.texels)):
            return None
        once = load.merged(self._size)
        forces = -once.forces * self._share[once.texels]
        total = -float(forces.sum())
        if not np.isfinite(total):
            raise SolverError(f"the forces of a load add up to {total!r} N; valid are finite numbers")
        self._backend.load(once.texels, forces, counterpart(once.texels, forces))
        self._uploaded = load
        return total
