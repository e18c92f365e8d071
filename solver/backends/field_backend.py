"""The part that all backends share: fields are read and replaced, and their crests are kept."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..operator.wave_operator import WaveOperator
from .gl_fields import DeviceField


class FieldBackend:
    """Height, velocity and permanent height as float32 fields of one layout.

    A backend says what its fields are: arrays on the CPU, buffers on the GPU. The layout `_fields`
    makes fields of zeros, and reads and writes their texels. See `Backend` for the methods.
    """

    _operator: WaveOperator
    _fields: Any  # RowLayout or FieldLayout
    _h: Any  # elastic part of the height [m]
    _v: Any  # velocity [m/s]
    _dent: Any = None  # permanent part of the height [m], where there is any
    _crests: Any = None  # greatest size of the height [m], from the first call of `crests` on
    _probes: Any = None
    _sums: NDArray[np.float32]  # of the probes, [substeps, k]

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [C, n, n]."""
        elastic = self.elastic()
        return elastic if self._dent is None else elastic + self.dent()

    def snapshot(self) -> NDArray[np.float32] | DeviceField:
        """Copy of the height [m], [C, n, n], where the waves are."""
        return self.height()

    def elastic(self) -> NDArray[np.float32]:
        """Copy of the part of the height that springs back [m], [C, n, n]."""
        return self._fields.read(self._h)

    def dent(self) -> NDArray[np.float32]:
        """Copy of the part of the height that stays [m], [C, n, n]."""
        if self._dent is None:
            return np.zeros(self._operator.mass.shape, np.float32)
        return self._fields.read(self._dent)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        self._apply_kicks()
        return self._fields.read(self._v)

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height since the last call [m], [C, n, n].

        It counts after every `advance`, and now.
        """
        if self._crests is None:
            self._crests = self._fields.zeros()
        self._raise_crests()
        crests = self._fields.read(self._crests)
        self._fields.write(self._crests, np.float32(0))
        return crests

    def set_height(
        self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None
    ) -> None:
        """Replace the elastic height, and the permanent height, which is 0 by default."""
        self._fields.write(self._h, height)
        if self._dent is None and dent is not None and dent.any():
            # dents of an earlier material, in a surface that does not yield itself
            self._dent = self._fields.zeros()
        if self._dent is not None:
            self._fields.write(self._dent, np.zeros_like(height) if dent is None else dent)

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._fields.write(self._v, velocity)
        self._drop_kicks()

    def probed(self) -> NDArray[np.float32]:
        """The sums of the latest `advance`, [substeps, k]."""
        return self._sums

    def wait(self) -> None:
        """Return at once: all steps are done."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self._h.sum()))

    def _apply_kicks(self) -> None:
        """Add the velocities that kicks have only noted."""

    def _drop_kicks(self) -> None:
        """Forget the velocities that kicks have noted."""

    def _raise_crests(self) -> None:
        """Raise the crests to the height where that is greater."""
        crests = np.maximum(self._fields.read(self._crests), np.abs(self.height()))
        self._fields.write(self._crests, crests)
