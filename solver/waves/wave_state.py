"""All that decides how waves go on: what one solver hands to another."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .load import Load


@dataclasses.dataclass(frozen=True, eq=False)
class WaveState:
    """The state of a wave solver at a time; see `WaveSolver.state`.

    Attributes
    ----------
    elastic, dent : float32 [C, n, n]
        The part of the height that springs back and the part that stays [m]; the height is their sum.
    velocity : float32 [C, n, n]
        [m/s].
    held : Load
        Forces held until further notice.
    time, substep : float
        [s]; the substep is the latest one, which `energy` needs.
    substeps_taken : int
    """

    elastic: NDArray[np.float32]
    dent: NDArray[np.float32]
    velocity: NDArray[np.float32]
    held: Load
    time: float
    substep: float
    substeps_taken: int
