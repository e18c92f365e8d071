"""A limit on the height that is drawn, so that a surface with waves too high for it does not pass through itself."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ..texels.atlas import Atlas
from ..texels.medial_radius import LEAST, medial_radius

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

    @functools.cached_property
    def radius(self) -> NDArray[np.float32]:
        """The medial radius R [m], [C, n, n]: it takes a while, and most waves never ask for it."""
        return medial_radius(self._atlas)

    def may_bend(self, highest: float) -> bool:
        """Whether heights of at most that size [m] may be drawn otherwise than they are."""
        return highest > self._always_free

    def __call__(self, height: NDArray[np.float32]) -> NDArray[np.float32]:
        """The heights to draw [m], float32 [C, n, n]; the same array where none is beyond the limit."""
        high, radius, beyond = self._beyond(height)
        if not len(radius):
            return height
        drawn = height.copy()
        drawn[high] = np.sign(height[high]) * radius * (FREE + (MOST - FREE) * np.tanh(beyond))
        return drawn

    def rate(self, height: NDArray[np.float32], velocity: NDArray[np.float32]) -> NDArray[np.float32]:
        """Rate of the heights to draw [m/s], float32 [C, n, n], where heights change with a velocity."""
        high, radius, beyond = self._beyond(height)
        if not len(radius):
            return velocity
        rate = velocity.copy()
        rate[high] *= 1 - np.tanh(beyond) ** 2
        return rate

    def _beyond(self, height: NDArray[np.float32]) -> tuple[NDArray[np.bool_], NDArray, NDArray]:
        """Texels where heights are bent, the radius at each of these [k], and the hyperbolic tangent's argument [k]."""
        size = np.abs(height)
        if not self.may_bend(float(size.max())):
            return np.zeros(height.shape, np.bool_), np.empty(0, np.float32), np.empty(0, np.float32)
        share = size / self.radius
        high = share > FREE
        # the cap keeps float32 from overflowing, where tanh is 1 by far
        return high, self.radius[high], (np.minimum(share[high], 1e3) - FREE) / (MOST - FREE)
