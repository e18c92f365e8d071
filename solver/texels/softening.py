"""Softening of the few texels that would set the time step for all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .texel_mesh import TexelMesh

# No texel may be this much faster (by the sum of its weights over its area) than this share of all texels.
_FASTER, _BULK = 1.2, 0.99


def softening(texels: TexelMesh) -> NDArray[np.float64]:
    """Factors that slow those few texels down that would set the time step for all others, [C, n, n].

    Where the texel mesh crosses a crease, single texels are needles. Waves are through them in no time, even slowed
    down. Smooth surfaces that the texels resolve have none: on the sphere all factors are 1.
    """
    rate = texels.stencil(np.ones_like(texels.areas)).absolute_sums() / texels.areas
    return np.minimum(1, _FASTER * np.quantile(rate, _BULK) / rate)
