"""The largest eigenvalue of an operator on texels, which sets the time step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh_tridiagonal

# Largest eigenvalue of an even grid's stencil times its spacing squared: that of the chessboard pattern.
EVEN_RATE = 6.4

# On smaller charts Gershgorin's bound is as good.
_LANCZOS_FROM = 6

# Residual of the eigenvalue, as a share of it; Lanczos steps from one look at it to the next, and at most.
_RESIDUAL, _LOOK, _MOST = 2e-3, 5, 1000


def largest_eigenvalue(
    force: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    mass: NDArray[np.float64],
    free: NDArray[np.bool_],
    bound: float,
) -> float:
    """Upper bound, within about 0.5 %, of the largest eigenvalue of -M^-1 force, by Lanczos iteration.

    Parameters
    ----------
    force : callable
        Linear, from a field [C, n, n] to one.
    mass : float64 [C, n, n]
    free : bool [C, n, n]
        The other texels do not move.
    bound : float
        One that is always safe, such as Gershgorin's, caps the estimate.
    """
    if not free.any():
        return 0.0
    if bound == 0 or mass.shape[1] < _LANCZOS_FROM:
        return bound
    weight = free / np.sqrt(mass)

    def multiply(x: NDArray) -> NDArray:
        return -(force(x.reshape(weight.shape) * weight) * weight).ravel()

    start = np.random.default_rng(0).standard_normal(mass.size)
    return float(np.clip(1.005 * _lanczos(multiply, start, bound), 0, bound))


def _lanczos(multiply: Callable[[NDArray], NDArray], start: NDArray[np.float64], bound: float) -> float:
    """Largest eigenvalue of a symmetric matrix; the bound if it is not found.

    Plain Lanczos, without a basis that is kept orthogonal: lost orthogonality repeats eigenvalues and makes no new ones
    (Paige 1972), and the sums are numpy's own, since BLAS' threads wait for each other where others use the cores.
    """
    before, vector = np.zeros_like(start), start / np.sqrt((start * start).sum())
    diagonal: list[float] = []
    side: list[float] = []
    for step in range(1, _MOST + 1):
        rest = multiply(vector) - (side[-1] if side else 0.0) * before
        diagonal.append(float((vector * rest).sum()))
        rest -= diagonal[-1] * vector
        length = float(np.sqrt((rest * rest).sum()))
        if step % _LOOK == 0 or length == 0.0:
            top, vectors = eigh_tridiagonal(diagonal, side, select="i", select_range=(step - 1, step - 1))
            if length * abs(vectors[-1, 0]) <= _RESIDUAL * abs(top[0]):
                return float(top[0])
        side.append(length)
        before, vector = vector, rest / length
    return bound
