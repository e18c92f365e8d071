"""The wave of a Gaussian bump on the plane, in closed form: when its front and its crest arrive."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.special import j0

from .first_crest import front_and_crest

# Below this many widths from the source there is no crest yet.
NEAREST = 5.0


def plane_arrival(distance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times of the front and the crest on the plane for the same bump; lengths in widths, wave speed 1."""
    grid, front, crest = _plane_table(float(max(np.max(distance, initial=0), NEAREST + 1)))
    return np.interp(distance, grid, front), np.interp(distance, grid, crest)


@functools.lru_cache(maxsize=16)
def _plane_table(farthest: float) -> tuple[NDArray[np.float64], ...]:
    """h(r, t) = integral of exp(-q^2 / 2) J0(q r) cos(q t) q dq, the bump's Hankel transform carried on in time."""
    grid = np.linspace(NEAREST - 1, farthest, 48)
    q = np.linspace(0, 8, 4001)[1:]
    spectrum = q * np.exp(-q * q / 2)
    around = np.linspace(-4, 3, 281)
    picked = []
    for r in grid:
        times = r + around
        height = np.cos(np.outer(times, q)) @ (spectrum * j0(q * r))
        picked.append(np.concatenate(front_and_crest(times, height[:, None])))
    front, crest = np.array(picked).T
    return grid, front, crest
