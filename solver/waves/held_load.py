"""The load of the coming steps: forces held until further notice, and those of a single step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.backends.backend import Backend
from ripple_sim.solver.errors import SolverError

from .load import Load


class HeldLoad:
    """Forces that a backend holds over its steps.

    Parameters
    ----------
    backend : Backend
    shape : tuple
        Of a field, (C, n, n).
    """

    def __init__(self, backend: Backend, shape: tuple[int, ...]) -> None:
        self._backend = backend
        self._shape = shape
        self._size = int(np.prod(shape))
        self._held = Load.none()
        self._uploaded = self._held

    def forces(self) -> NDArray[np.float64]:
        """Forces held at every texel [N], positive inwards, [C, n, n]."""
        forces = np.bincount(self._held.texels, self._held.forces, self._size).astype(np.float64, copy=False)
        return forces.reshape(self._shape)

    def clear(self) -> None:
        """Hold nothing."""
        self._held = Load.none()

    def add(self, load: Load) -> None:
        """Hold a load beside what is held."""
        self._held = Load.together([self._held, load]).merged(self._size)

    def upload(self, extra: Load | None, counterpart: Callable[[float], float]) -> None:
        """Hand the backend the load of the coming step, with `extra` for that step alone, unless it has it already.

        Parameters
        ----------
        extra : Load or None
        counterpart : callable
            From the force [N] that enters to the acceleration [m/s^2] of all movable texels that balances it.

        Raises
        ------
        SolverError
            If the forces are not finite, or a texel does not exist.
        """
        load = self._held if extra is None else Load.together([self._held, extra])
        if load is self._uploaded or not (len(load.texels) or len(self._uploaded.texels)):
            return
        once = load.merged(self._size)
        total = float(once.forces.sum())
        if not np.isfinite(total):
            raise SolverError(f"the forces of a load add up to {total!r} N; valid are finite numbers")
        self._backend.load(once.texels, -once.forces, counterpart(-total))
        self._uploaded = load
