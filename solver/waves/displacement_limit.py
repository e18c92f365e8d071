"""A limit on the height that is drawn, so that a surface with waves too high for it does not pass through itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.medial_radius import LEAST, medial_radius

# Of the medial radius: heights up to the first share are drawn as they are, and none beyond the second.
FREE, MOST = 0.25, 0.6


class DisplacementLimit:
    """Bends heights that are large beside the object's local radius, and leaves the others alone.

    With R the medial radius at a texel (see `medial_radius`), a height h is drawn as it is up to R / 4. Beyond, it is
    drawn as R (a + (b - a) tanh((|h| / R - a) / (b - a))) with its sign, a = 1/4 and b = 0.6: twice continuously
    differentiable, growing with h, and never more than 0.6 R. The waves themselves know nothing of it.

    Parameters
    ----------
    atlas : Atlas
    """

    def __init__(self, atlas: Atlas) -> None:
        self._atlas = atlas
        self._always_free = FREE * LEAST * float(np.ptp(atlas.mesh.V, axis=0).max())
        self._radius: NDArray[np.float32] | None = None

    def __call__(self, height: NDArray[np.float32]) -> NDArray[np.float32]:
        """The heights to draw [m], float32 [C, n, n]; the same array where none is beyond the limit."""
        size = np.abs(height)
        if not size.max() > self._always_free:
            return height
        if self._radius is None:
            self._radius = medial_radius(self._atlas).astype(np.float32)
        share = size / self._radius
        high = share > FREE
        if not high.any():
            return height
        drawn = height.copy()
        # the cap keeps float32 from overflowing, where tanh is 1 by far
        share = np.minimum(share, 1e3)
        bent = FREE + (MOST - FREE) * np.tanh((share[high] - FREE) / (MOST - FREE))
        drawn[high] = np.sign(height[high]) * self._radius[high] * bent
        return drawn
