"""Texels that are too fast: more mass or less stiffness, so that they do not set the time step.

A few small texels would set the time step for all. Areas are evened out first: such a texel gets
mass from its neighbours. The stiffness of those that are still too fast is lowered.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import MatrixRankWarning, spsolve

from ..kernel import Floats
from .stencil import EVEN_RATE, Stencil, stiffness_matrix

# Texels of a smooth surface that softening may take away, for each halving of the fastest rate. The
# loss falls with the square of their size, as the error of the operator does: eigenvalues stay of
# second order.
_MAX_LOST_TEXELS = 0.5

# Needles at creases may lose more: texels that are faster than the bulk of the surface by this
# factor. Rings of narrow texels round a limb are hardly faster. All waves along the limb pass
# through them, and softening them made the lowest frequencies too low.
_NEEDLE_RATE = 2.0

# Needles lose more only where the time step would be less than this share of an even grid's.
_MIN_STEP_SHARE = 0.45

# Share of the surface that is its bulk: texels as fast as the bulk stay as they are.
_BULK_SHARE = 0.99

# Texels faster than the bulk by no more than this factor stay as they are, too.
_TOLERATED_RATE = 1.2

# Greatest change of eigenvalues for the sake of the time step, in units of about the error of the
# operator.
_MAX_CHANGE = 0.07

# Area to which a texel may grow, in mean texels: more would leave a hole round a needle.
_MAX_AREA = 3.0

# Share of the area of a part of the mesh that its texels may lack together. Where they lack more,
# the part is tiny and too fast altogether, and stays as it is.
_MAX_LACK_SHARE = 0.2

# Newton steps for the least potential.
_MAX_NEWTON_STEPS = 50

# Halvings, in logarithms, of the range of bounds in which the lowest possible one is sought.
_BOUND_HALVINGS = 6

# Rounding error of the lack of a texel, over the sum of all lacks.
_LACK_ROUNDOFF = 1e-9

# The mean square of a mode of wave number k changes by the share 2 k^2 w, and the error of the
# operator is the share k^2 h^2 / 12: w over this many h^2 is one such error.
_ERRORS_PER_POTENTIAL = 24


def evened_areas(areas: Floats, stencil: Stencil) -> Floats:
    """Areas [C, n, n] with mass moved from neighbours to the few texels that are too fast.

    Those texels would set the time step for all. K w is added to the areas, with the stiffness K of
    a uniform surface and the least w >= 0 for which no texel is faster than a bound. K w has no sum
    and, except for the curvature, no first moment: total area and centre of mass stay. The mean
    square of the heights of a mode of wave number k changes by 2 k^2 times the mean of w, where the
    error of the operator is k^2 h^2 / 12. The bound is as low as a share of this error allows.
    """
    flat = areas.ravel()
    pull = stencil.absolute_sums().ravel()
    matrix = stiffness_matrix(stencil)
    if not pull.any():  # a single texel
        return areas
    rate = pull / flat
    part = connected_components(matrix, directed=False)[1]
    part_area = np.bincount(part, flat)
    max_area = np.maximum(flat, _MAX_AREA * flat.mean())
    max_change = _MAX_CHANGE * flat.mean() * flat.sum()
    best = flat
    low = _TOLERATED_RATE * _bulk_rate(rate, flat)
    high = float(rate.max())
    bound = max(low, _min_step_rate(flat))  # beyond which texels are softened, if need be
    for _ in range(_BOUND_HALVINGS):
        lack = np.minimum(pull / bound, max_area) - flat
        part_lack = np.bincount(part, np.maximum(lack, 0))
        is_too_fast = part_lack > _MAX_LACK_SHARE * part_area
        lack[is_too_fast[part]] = -np.inf
        potential = _least_potential(matrix, lack)
        if potential is not None and _ERRORS_PER_POTENTIAL * (potential @ flat) <= max_change:
            best = flat + matrix @ potential
            high = bound
        else:
            low = bound
        bound = np.sqrt(low * high)
    return best.reshape(areas.shape)


def _least_potential(matrix: csr_array, lack: Floats) -> Floats | None:
    """The least w >= 0 with K w >= lack, an obstacle problem; None if it is not found.

    Newton's method finds the texels where w > 0 (Hintermueller, Ito and Kunisch 2002).
    """
    w = np.zeros_like(lack)
    is_positive = lack > 0
    for _ in range(_MAX_NEWTON_STEPS):
        texels = np.flatnonzero(is_positive)
        w[:] = 0
        if len(texels):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error", MatrixRankWarning)
                    w[texels] = spsolve(matrix[texels][:, texels].tocsc(), lack[texels])
            except MatrixRankWarning:  # all of a part: nothing beside it gives mass
                return None
        was_positive = is_positive
        round_off = _LACK_ROUNDOFF * np.abs(lack[texels]).sum()
        is_positive = np.where(is_positive, w > 0, matrix @ w < lack - round_off)
        if (is_positive == was_positive).all():
            return w
    return None


def _min_step_rate(areas: Floats) -> float:
    """Rate at which the time step is `_MIN_STEP_SHARE` of an even grid's."""
    return float(EVEN_RATE / (2 * areas.mean() * _MIN_STEP_SHARE**2))


def softening(rate: Floats, areas: Floats) -> Floats:
    """Factors of stiffness that slow down the few texels that are still too fast, [C, n, n].

    Where the texel mesh crosses a crease, single texels are needles, for which the mass of their
    neighbours is not enough. Waves are through them in no time, even slowed down. On smooth
    surfaces that the texels resolve, little or nothing is softened; nothing on a sphere.

    Parameters
    ----------
    rate : float64 [C, n, n]
        Sum of the sizes of each texel's weights over its area [1/m^2].
    areas : float64 [C, n, n]
        [m^2]
    """
    # the least rate to which softening may bring the faster ones; texels without links have none
    order = np.argsort(-rate.ravel())[: np.count_nonzero(rate)]
    rates = rate.ravel()[order]
    shares = (areas.ravel() / areas.mean())[order]
    lost = np.cumsum(shares) - rates * np.cumsum(shares / rates)  # [texels]
    allowed = _MAX_LOST_TEXELS * np.log2(rates[0] / rates) + 1e-9
    cheapest = float(rates[np.flatnonzero(lost <= allowed)[-1]])
    bulk = _bulk_rate(rate.ravel(), areas.ravel())
    needles = max(_NEEDLE_RATE * bulk, _min_step_rate(areas))
    bound = max(min(cheapest, needles), _TOLERATED_RATE * bulk)
    return np.divide(bound, rate, out=np.ones_like(rate), where=rate > bound)


def _bulk_rate(rates: Floats, areas: Floats) -> float:
    """The rate that the bulk of the surface, by area, has at most.

    By area, since tiny parts may have many texels.
    """
    order = np.argsort(rates)
    covered = np.cumsum(areas[order])
    return float(rates[order[np.searchsorted(covered, _BULK_SHARE * covered[-1])]])
