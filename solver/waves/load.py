"""Loads: forces on some texels over a step, forces that a solver holds, and a solver's state."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..backends.backend import Backend, TexelLoad
from ..errors import SolverError
from ..operator.volume import VolumeBalance


class StepLoad(Protocol):
    """Forces that act over one step: a `Load`, or a load that changes within the step.

    Only a `Load` can be added to others by `Load.together`, which would lose the changes.
    """

    def parts(self, dt: float, substeps: int) -> Iterator[tuple[int, Load]]:
        """Constant loads that act one after the other, each with its number of substeps.

        Parameters
        ----------
        dt : float
            The step [s].
        substeps : int
            Of the whole step: the numbers of all parts add up to it.
        """


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
        """The sum of several loads."""
        loads = [load for load in loads if len(load.texels)]
        if not loads:
            return cls.none()
        if len(loads) == 1:
            return loads[0]
        return cls(
            np.concatenate([load.texels for load in loads]),
            np.concatenate([load.forces for load in loads]),
        )

    def parts(self, dt: float, substeps: int) -> Iterator[tuple[int, Load]]:
        """The load itself, over all substeps of a step of dt [s]; see `StepLoad`."""
        yield substeps, self

    def merged(self, size: int) -> Load:
        """The load with every texel once, on an atlas of `size` texels.

        Raises
        ------
        SolverError
            If a texel is not one of the atlas.
        """
        texels = self.texels
        if len(texels) and not 0 <= texels.min() <= texels.max() < size:
            raise SolverError(
                f"texels of a load must be indices from 0 to {size - 1}, got {texels.min()} to "
                f"{texels.max()}"
            )
        if (texels[1:] > texels[:-1]).all():
            return self
        row = np.arange(len(texels))
        row_of_texel = np.empty(size, np.int64)
        row_of_texel[texels[::-1]] = row[::-1]
        first = row_of_texel[texels]  # the row in which each texel appears first
        once = (first == row).nonzero()[0]
        merged_texels = texels[once]
        row_of_texel[merged_texels] = row[: len(once)]
        merged_forces = np.bincount(row_of_texel[texels], self.forces)
        return Load(merged_texels, merged_forces.astype(np.float64, copy=False))


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
    backend : Backend
    share : float64 [C, n, n]
        The part of a force on a texel that sets the texel in motion.
    balance : VolumeBalance
        Balances the forces where volume is conserved.

    Attributes
    ----------
    load : Load
        The forces that are held; assign to change them.
    balance : VolumeBalance
        Assign to change it.
    backend : Backend
        Assign to change it.
    """

    def __init__(
        self, backend: Backend, share: NDArray[np.float64], balance: VolumeBalance
    ) -> None:
        self.load = Load.none()
        self.balance = balance
        self.backend = backend
        self._share = share
        self._uploaded = self.load

    def forces(self) -> NDArray[np.float64]:
        """Forces held at every texel [N], positive inwards, [C, n, n]."""
        forces = np.bincount(self.load.texels, self.load.forces, self._share.size)
        return forces.astype(np.float64, copy=False).reshape(self._share.shape)

    def add(self, load: Load) -> None:
        """Hold a load beside the forces that are held already."""
        self.load = Load.together([self.load, load]).merged(self._share.size)

    def counterpart(
        self, texels: NDArray[np.int64], momenta: NDArray[np.float64]
    ) -> float | NDArray[np.float64]:
        """Outward momenta or forces that balance those on some texels and conserve the volume."""
        return self.balance.counterpart(texels, momenta)

    def upload_again(self) -> None:
        """Hand the backend the load once more at the coming step, although it has the load."""
        self._uploaded = Load(self._uploaded.texels, self._uploaded.forces)

    def upload(self, extra: Load | None) -> float | None:
        """Hand the backend the load of the coming step, unless it has the load already.

        Parameters
        ----------
        extra : Load, optional
            Acts over the coming step alone, beside the forces that are held.

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
                f"the forces of a load must be finite, got forces that add up to {total!r} N"
            )
        acceleration = self.counterpart(once.texels, forces)
        self.backend.hold(TexelLoad(once.texels, forces, acceleration))
        self._uploaded = load
        return total
