"""Area of the surface that belongs to each texel.

The texel mesh cuts corners where the surface is creased, and spans twists that the surface has not: its area is up to
2 % too small or too large at N = 96. The map onto the charts knows better: a texel's share is its area on the charts
times the real area for each unit of that in the texel's triangle. Alone that is one sample a texel, exact in the mean
and noisy where triangles are uneven; so the texel mesh gives the shape of the field, the map its level in every
neighbourhood.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .smoothing import smoothed
from .topology import TexelTopology

# Least and most area in units of what the texel mesh spans. A limb that falls between the texels is not theirs.
_LEAST, _MOST = 0.5, 1.2
_POSITIVE = 0.05  # of what the map says, on average round a texel; a folded one may span less than nothing


def levelled_areas(
    topology: TexelTopology, spanned: NDArray[np.float64], sampled: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Area of the surface that belongs to each texel [m^2], [C, n, n].

    Parameters
    ----------
    topology : TexelTopology
    spanned : float64 [C, n, n]
        Area that the texel mesh spans [m^2]; see `lumped_areas`.
    sampled : float64 [C, n, n]
        What the map onto the charts says of each texel [m^2].
    """
    around = smoothed(topology, sampled)
    level = around / np.maximum(smoothed(topology, spanned), 1e-300)
    return np.maximum(spanned * np.clip(level, _LEAST, _MOST), _POSITIVE * around)
