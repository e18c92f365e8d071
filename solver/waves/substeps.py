"""How many substeps a step takes."""

from __future__ import annotations

import numpy as np

from ..checked import shown, whole
from ..errors import SolverError

# A step that needs more is a mistake in a unit, and would run for ever.
_MOST = 1_000_000
_ONE_OR_MORE = whole(1)


def count_substeps(dt: float, stable: float, asked: int | None) -> int:
    """Number of equal substeps for a step of dt [s], at most `stable` [s] long each.

    Parameters
    ----------
    dt, stable : float
        [s].
    asked : int or None
        How many the caller wants; None: the fewest.

    Raises
    ------
    SolverError
        If the step would take far too many, or fewer are asked for than stability allows.
    """
    ratio = dt / stable * (1 - 1e-12)
    if not ratio < _MOST:
        raise SolverError(
            f"a step of {dt:.4g} s would take {ratio:.3g} substeps of the stable {stable:.4g} s; "
            f"valid are {_MOST} at most: take shorter steps, or a material with slower waves"
        )
    needed = max(1, int(np.ceil(ratio)))
    if asked is None:
        return needed
    if not (_ONE_OR_MORE.holds(asked) and asked <= _MOST):
        raise SolverError(
            f"substeps is {shown(asked)}; valid is {_ONE_OR_MORE.words}, up to {_MOST}, or None for the fewest"
        )
    if asked < needed:
        raise SolverError(
            f"{asked} substeps of {dt / max(asked, 1):.4g} s are longer than the stable {stable:.4g} s; "
            f"use {needed} or more substeps, or leave the number out"
        )
    return asked
