"""Checks that numbers, fields and heights are finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checked import is_finite, shown
from ..errors import SolverError
from ..texels.atlas import Atlas


def where_not_finite(atlas: Atlas, field: NDArray) -> str | None:
    """Name the place from which NaN or infinity spreads in a field [C, n, n], or None where all is finite."""
    if np.isfinite(field.sum(dtype=np.float64)):
        return None
    bad = ~np.isfinite(field)
    # it spreads by a texel a substep on all sides, so it began in the middle
    places = atlas.positions[bad]
    middle = np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=1))
    chart, row, column = np.argwhere(bad)[middle]
    x, y, z = places[middle]
    where = f"at chart {chart}, row {row}, column {column}, ({x:.4g}, {y:.4g}, {z:.4g}) m"
    return f"{where} ({bad.sum()} of {bad.size} texels)"


def as_field(value: ArrayLike, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """A number, or an array of the given shape, as a float32 field [C, n, n].

    Raises
    ------
    SolverError
        If the shape is another one, or a value is not finite.
    """
    try:
        array = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(f"{name} is {shown(value)}; valid is a number, or an array of shape {shape}") from error
    if array.shape not in ((), shape):
        raise SolverError(f"{name} has shape {array.shape}; valid is {shape}, or one number")
    array = np.broadcast_to(array, shape)
    if not np.isfinite(array).all():
        raise SolverError(f"{name} holds {(~np.isfinite(array)).sum()} values that are NaN or infinite")
    return array


def require_finite(name: str, value: float, unit: str, least: float = -np.inf) -> None:
    """Raise `SolverError` unless a value is a finite number, of at least `least`."""
    if not (is_finite(value) and value >= least):
        bound = "" if least == -np.inf else f", {least:g} or greater"
        raise SolverError(f"{name} is {shown(value)} {unit}; valid is a finite number{bound}")
