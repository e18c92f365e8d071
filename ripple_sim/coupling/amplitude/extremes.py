"""How high and how steep waves are, beside what the object allows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats32, kernel
from ripple_sim.solver.texels.thickness import half_thickness

# The height allowed over the local radius.
HIGH = 0.25

# Of the surface, what is counted as the thinnest part is beyond this share.
_THINNEST = 0.99

_ROWS = 4


class Scales(NamedTuple):
    """What heights are compared with; fields are [C, n, n].

    Attributes
    ----------
    per_limit
        1 over the greatest height allowed [1/m].
    per_row, per_column
        1 over the distance to the next texel in the next row and column [1/m]; 0 beyond the chart.
    share
        Of the surface's area.
    per_thinnest : float
        1 over the greatest height allowed where the object is thinnest [1/m].
    calm : float
        Waves that are no higher are neither too high nor too steep anywhere [m].
    """

    per_limit: Floats32
    per_row: Floats32
    per_column: Floats32
    share: Floats32
    per_thinnest: float
    calm: float


def scales_of(atlas: Atlas) -> Scales:
    """What the heights on an atlas are compared with."""
    fields = np.zeros((4, *atlas.areas.shape))
    fields[0] = 1 / (HIGH * half_thickness(atlas))
    for axis in (1, 2):
        spacing = np.linalg.norm(np.diff(atlas.positions, axis=axis), axis=-1)
        inner = (slice(None),) * axis + (slice(None, -1),)
        # needles, on which a slope means little
        fields[axis][inner] = 1 / np.maximum(spacing, 0.5 * np.median(spacing))
    fields[3] = atlas.areas / atlas.areas.sum()
    thinnest = float(np.quantile(fields[0], _THINNEST))
    # no slope can reach 1 where neighbours differ by twice this height at most
    calm = min(1 / fields[0].max(), 1 / (8**0.5 * fields[1:3].max()))
    per_limit, per_row, per_column, share = fields.astype(np.float32)
    return Scales(per_limit, per_row, per_column, share, thinnest, float(calm))


def highest(crests: NDArray[np.float32], scales: Scales) -> tuple[float, int]:
    """The greatest crest over what is allowed there, and its texel; crests are sizes of heights, see `crests`."""
    share = (crests * scales.per_limit).reshape(-1)
    texel = int(share.argmax())
    return float(share[texel]), texel


@kernel
def steep_area(height: Floats32, per_row: Floats32, per_column: Floats32, share: Floats32) -> float:
    """Share of the surface that is steeper than 1, seen on every fourth row."""
    charts, n, _ = height.shape
    steep, all_seen = 0.0, 0.0
    for f in range(charts):
        for r in range(0, n - 1, _ROWS):
            for c in range(n - 1):
                h = height[f, r, c]
                down = (height[f, r + 1, c] - h) * per_row[f, r, c]
                right = (height[f, r, c + 1] - h) * per_column[f, r, c]
                all_seen += share[f, r, c]
                if down * down + right * right > 1:
                    steep += share[f, r, c]
    return steep / all_seen


def slope_of_share(height: NDArray[np.float32], scales: Scales, share: float) -> float:
    """The slope that a share of the surface exceeds."""
    down = np.diff(height, axis=1, append=0) * scales.per_row
    right = np.diff(height, axis=2, append=0) * scales.per_column
    slope = np.hypot(down, right).ravel()
    order = np.argsort(-slope)
    return slope[order[np.searchsorted(np.cumsum(scales.share.ravel()[order]), share)]]
