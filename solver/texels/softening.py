"""Softening of the few texels that would set the time step for all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .spectrum import EVEN_RATE
from .texel_mesh import TexelMesh

# What softening may take from a smooth surface, in texels, for each halving of the fastest rate. It falls with the
# square of their size, as the error of the operator does: eigenvalues stay of second order.
_TEXELS = 0.5

# Needles at creases may lose more, where the time step would be less than this share of an even grid's.
_STEP = 0.45

# All but this share of the surface at most stays as it is, and texels that are hardly faster.
_BULK, _FASTER = 0.99, 1.2


def softening(texels: TexelMesh) -> NDArray[np.float64]:
    """Factors that slow those few texels down that would set the time step for all others, [C, n, n].

    Where the texel mesh crosses a crease, single texels are needles. Waves are through them in no time, even slowed
    down. On smooth surfaces that the texels resolve little is softened, or nothing, as on the sphere.
    """
    areas = texels.areas
    rate = texels.stencil(np.ones_like(areas)).absolute_sums() / areas
    even = EVEN_RATE / (2 * areas.mean() * _STEP**2)
    bound = min(_cheapest(rate.ravel(), areas.ravel() / areas.mean()), even)
    return np.minimum(1, max(bound, _FASTER * _bulk(rate.ravel(), areas.ravel())) / rate)


def _bulk(rates: NDArray[np.float64], areas: NDArray[np.float64]) -> float:
    """The rate that most of the surface has at most: tiny parts may have many texels."""
    order = np.argsort(rates)
    covered = np.cumsum(areas[order])
    return float(rates[order[np.searchsorted(covered, _BULK * covered[-1])]])


def _cheapest(rates: NDArray[np.float64], areas: NDArray[np.float64]) -> float:
    """The least rate, of those of the texels, to which softening may bring the faster ones; areas in mean ones."""
    order = np.argsort(-rates)
    rates, areas = rates[order], areas[order]
    lost = np.cumsum(areas) - rates * np.cumsum(areas / rates)
    return float(rates[np.flatnonzero(lost <= _TEXELS * np.log2(rates[0] / rates) + 1e-9)[-1]])
