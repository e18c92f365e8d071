"""`SurfaceFields`: height, velocity and crests of a surface, as the fields of a backend."""

from __future__ import annotations

import dataclasses
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

# A field as a backend keeps it: an array on the CPU, a buffer on the GPU.
Field = TypeVar("Field")


class Layout(Protocol[Field]):
    """How a backend lays out a field [C, n, n] of float32 numbers."""

    def zeros(self) -> Field:
        """A field of zeros."""

    def read(self, field: Field, /) -> NDArray[np.float32]:
        """Copy of the texels of a field, [C, n, n]."""

    def write(self, field: Field, values: NDArray | np.float32, /) -> None:
        """Replace the texels of a field."""


@dataclasses.dataclass
class SurfaceFields(Generic[Field]):
    """The fields of a surface, which backends have and change.

    Attributes
    ----------
    layout : Layout
    shape : (C, n, n)
        Shape of the arrays that are read and written.
    h : field
        Part of the height that springs back [m].
    v : field
        Velocity [m/s].
    dent : field, optional
        Part of the height that stays [m]; None as long as there is none.
    crests : field, optional
        Greatest size of the height so far [m]; None as long as nobody asks for it.
    """

    layout: Layout[Field]
    shape: tuple[int, ...]
    h: Field
    v: Field
    dent: Field | None = None
    crests: Field | None = None

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [C, n, n]."""
        elastic = self.elastic_height()
        return elastic if self.dent is None else elastic + self.permanent_height()

    def elastic_height(self) -> NDArray[np.float32]:
        """Copy of the part of the height that springs back [m], [C, n, n]."""
        return self.layout.read(self.h)

    def permanent_height(self) -> NDArray[np.float32]:
        """Copy of the part of the height that stays [m], [C, n, n]."""
        if self.dent is None:
            return np.zeros(self.shape, np.float32)
        return self.layout.read(self.dent)

    def set_height(
        self, elastic: NDArray[np.float32], permanent: NDArray[np.float32] | None = None
    ) -> None:
        """Replace the elastic height [m], and the permanent height [m], which is 0 by default."""
        self.layout.write(self.h, elastic)
        if self.dent is None and permanent is not None and permanent.any():
            # dents of an earlier material, in a surface that does not yield itself
            self.dent = self.layout.zeros()
        if self.dent is not None:
            self.layout.write(self.dent, np.float32(0) if permanent is None else permanent)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        return self.layout.read(self.v)

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity [m/s]."""
        self.layout.write(self.v, velocity)

    def watched_crests(self) -> Field:
        """The field of the crests, which is there from the first call on."""
        if self.crests is None:
            self.crests = self.layout.zeros()
        return self.crests

    def take_crests(self) -> NDArray[np.float32]:
        """Copy of the crests [m], [C, n, n]; the crests restart at 0."""
        field = self.watched_crests()
        crests = self.layout.read(field)
        self.layout.write(field, np.float32(0))
        return crests
