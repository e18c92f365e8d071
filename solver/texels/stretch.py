"""How even texels are: quantiles of their stretch over the area."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats

# Quantiles of the stretch by name, as shares of the area.
QUANTILES = {"q001": 0.001, "q01": 0.01, "q50": 0.5, "q99": 0.99, "q999": 0.999}

# Stretch from which on texels are too wide: an area beyond it is starved.
STARVED = 4.0


def stretch_summary(stretch: Floats, areas: Floats) -> dict[str, float]:
    """Quantiles of the stretch [m] over the real areas [m], and the starved share.

    See `Atlas.quality`.
    """
    order = np.argsort(stretch, kind="stable")
    share = np.cumsum(areas[order]) / areas.sum()
    at = np.minimum(np.searchsorted(share, list(QUANTILES.values())), len(order) - 1)
    starved = float(areas[stretch > STARVED].sum() / areas.sum())
    return {**dict(zip(QUANTILES, stretch[order][at].tolist(), strict=True)), "starved": starved}
