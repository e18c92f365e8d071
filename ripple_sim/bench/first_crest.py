"""The first crest of a signal, and the front that comes before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# A ripple below this share of the strongest signal is no crest.
_LEAST = 0.2


def front_and_crest(times: NDArray, signal: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [k] of the front and of the first crest in signals [time, k], interpolated between the samples.

    The front is where the signal first reaches half of that crest. Both are NaN where there is no crest.
    """
    probe = np.arange(signal.shape[1])
    before, here, after = signal[:-2], signal[1:-1], signal[2:]
    crests = (here >= before) & (here > after) & (here > _LEAST * signal.max(axis=0))
    i = np.argmax(crests, axis=0) + 1
    a, b, c = signal[i - 1, probe], signal[i, probe], signal[i + 1, probe]
    curvature = np.where(a - 2 * b + c < 0, a - 2 * b + c, -1)
    dt = times[1] - times[0]
    crest = times[i] + (a - c) / curvature / 2 * dt
    half = (b - (a - c) ** 2 / curvature / 8) / 2
    above = signal >= half
    above[0] = False
    j = np.maximum(np.argmax(above, axis=0), 1)
    low, high = signal[j - 1, probe], signal[j, probe]
    front = times[j - 1] + (half - low) / np.where(high > low, high - low, 1) * dt
    found = crests.any(axis=0)
    return np.where(found, front, np.nan), np.where(found, crest, np.nan)
