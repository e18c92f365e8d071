"""Loads: forces on some texels, held over a step, what a solver holds over the coming ones, and its state."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..backends.backend import Backend
from ..errors import SolverError
from ..operator.volume import VolumeBalance


@dataclasses.dataclass(frozen=True, eq=False)
class Load:
    """Constant forces on some texels.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices (chart n + row) n + column; a texel may occur more than once.
    forces : float64 [k]
        [N], positive inwards.
    """

    texels: NDArray[np.int64]
    forces: NDArray[np.float64]

    @classmethod
    def none(cls) -> Load:
        """No force anywhere."""
        return cls(np.zeros(0, np.int64), np.zeros(0))

    @classmethod
    def together(cls, loads: Sequence[Load]) -> Load:
        """Several loads at once."""
        loads = [load for load in loads if len(load.texels)]
        if not loads:
            return cls.none()
        if len(loads) == 1:
            return loads[0]
        return cls(
            np.concatenate([each.texels for each in loads]),
            np.concatenate([each.forces for each in loads]),
        )

    def parts(self, dt: float, substeps: int) -> Iterator[tuple[int, Load]]:
        """What acts over a step of dt [s]: numbers of its substeps, one after the other, and the load over each.

        A load that changes within a step gives several.
        """
        yield substeps, self

    def merged(self, size: int) -> Load:
        """The same with every texel once, on an atlas of so many texels.

        Raises
        ------
        SolverError
            If a texel is not one of the atlas.
        """
        texels = self.texels
        if len(texels) and not 0 <= texels.min() <= texels.max() < size:
            raise SolverError(
                f"texels go from {texels.min()} to {texels.max()}; valid are indices from 0 to "
                f"{size - 1}"
            )
        if (texels[1:] > texels[:-1]).all():
            return self
        row = np.arange(len(texels))
        place = np.empty(size, np.int64)
        place[texels[::-1]] = row[::-1]
        first = place[texels]  # the row in which each texel appears first
        once = (first == row).nonzero()[0]
        place[texels[once]] = row[: len(once)]
        return Load(
            texels[once], np.bincount(place[texels], self.forces).astype(np.float64, copy=False)
        )


@dataclasses.dataclass(frozen=True, eq=False)
class WaveState:
    """The state of a wave solver at a time; see `WaveSolver.state`.

    Attributes
    ----------
    elastic, dent : float32 [C, n, n]
        The part of the height that springs back and the part that stays [m]; the height is their
        sum.
    velocity : float32 [C, n, n]
        [m/s].
    held : Load
        Forces held until further notice.
    time, substep : float
        [s]; the substep is the latest one, which `energy` needs.
    substeps_taken : int
    """

    elastic: NDArray[np.float32]
    dent: NDArray[np.float32]
    velocity: NDArray[np.float32]
    held: Load
    time: float
    substep: float
    substeps_taken: int


class HeldLoad:
    """Forces that a backend holds over its steps.

    Parameters
    ----------
    share : float64 [C, n, n]
        Of a force that sets a texel in motion.
    balance : VolumeBalance
        Of the forces.

    Attributes
    ----------
    load : Load
        What is held; assign to change it.
    balance : VolumeBalance
        Likewise.
    """

    def __init__(
        self, backend: Backend, share: NDArray[np.float64], balance: VolumeBalance
    ) -> None:
        self._backend = backend
        self.balance = balance
        self._share = share
        self.load = self._uploaded = Load.none()

    def forces(self) -> NDArray[np.float64]:
        """Forces held at every texel [N], positive inwards, [C, n, n]."""
        forces = np.bincount(self.load.texels, self.load.forces, self._share.size)
        return forces.astype(np.float64, copy=False).reshape(self._share.shape)

    def add(self, load: Load) -> None:
        """Hold a load beside what is held."""
        self.load = Load.together([self.load, load]).merged(self._share.size)

    def counterpart(
        self, texels: NDArray[np.int64], momenta: NDArray[np.float64]
    ) -> float | NDArray[np.float64]:
        """What balances the momenta of a source on some texels, or forces, outwards, where volume is conserved."""
        return self.balance.counterpart(texels, momenta)

    def upload(self, extra: Load | None) -> float | None:
        """Hand the backend the load of the coming step, with `extra` for that step alone, unless it has it already.

        Returns
        -------
        float or None
            Sum of a new load's forces [N], positive inwards.

        Raises
        ------
        SolverError
            If the forces are not finite, or a texel does not exist.
        """
        load = self.load if extra is None else Load.together([self.load, extra])
        if load is self._uploaded or not (len(load.texels) or len(self._uploaded.texels)):
            return None
        once = load.merged(self._share.size)
        forces = -once.forces * self._share.reshape(-1)[once.texels]
        total = -float(forces.sum())
        if not np.isfinite(total):
            raise SolverError(
                f"the forces of a load add up to {total!r} N; valid are finite numbers"
            )
        self._backend.load(once.texels, forces, self.counterpart(once.texels, forces))
        self._uploaded = load
        return total
