"""What all backends share: height and velocity as fields, to be read, replaced, and watched for their crests."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..operator.wave_operator import WaveOperator
from .gl_fields import DeviceField


class FieldBackend:
    """Fields of one layout, each float32: height, velocity, and what stays of the height where anything does.

    The layout `_fields` makes fields of zeros, and reads and writes their texels.
    """

    _operator: WaveOperator
    _fields: Any
    _h: Any
    _v: Any
    _dent: Any = None
    _crests: Any = None
    _probes: Any = None
    _sums: NDArray[np.float32]

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
        """The part of the height that stays [m], [C, n, n]."""
        return (
            np.zeros(self._operator.mass.shape, np.float32)
            if self._dent is None
            else self._fields.read(self._dent)
        )

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        self._apply_kicks()
        return self._fields.read(self._v)

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height after any `advance` since the last call, or now [m], [C, n, n]."""
        if self._crests is None:
            self._crests = self._fields.zeros()
        self._raise_crests()
        crests = self._fields.read(self._crests)
        self._fields.write(self._crests, np.float32(0))
        return crests

    def set_height(
        self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None
    ) -> None:
        """Replace the elastic height, and the permanent one: 0 unless given."""
        self._fields.write(self._h, height)
        if self._dent is None and dent is not None and dent.any():
            # what another material has left, in a surface that does not yield itself
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
        """Return when all steps are done: at once, they are."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self._h.sum()))

    def _apply_kicks(self) -> None:
        """Add to the velocity what kicks have only noted."""

    def _drop_kicks(self) -> None:
        """Forget what kicks have noted."""

    def _raise_crests(self) -> None:
        """Raise the crests to the height where that is greater."""
        self._fields.write(
            self._crests, np.maximum(self._fields.read(self._crests), np.abs(self.height()))
        )
