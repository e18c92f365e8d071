"""Height maps of a target, wherever its surface is."""

from __future__ import annotations

import mujoco
import numpy as np

from ripple_sim.coupling.ripples import Ripples
from ripple_sim.render.height_maps import AnyHeightMap, MovedHeightMap
from ripple_sim.solver import HeightMap
from ripple_sim.solver.waves.motion import MovedGradients

from .shutter import Field


class DrawnHeights:
    """What a renderer needs of a target's heights.

    Parameters
    ----------
    ripples : Ripples
    name : str
        Of the target.
    limit : bool
        Whether heights that are too large for the object are bent, see `DisplacementLimit`.
    """

    def __init__(self, ripples: Ripples, name: str, limit: bool) -> None:
        self._ripples, self._name = ripples, name
        self._height_map = HeightMap.drawn(ripples[name].rest, limit)
        self._gradients: MovedGradients | None = None

    def __call__(self, height: Field, data: mujoco.MjData) -> AnyHeightMap:
        """Height map of heights [m], [C, n, n], with the vertices where they are in `data`, if they have moved."""
        height_map: AnyHeightMap = self._height_map(height)
        V = self._ripples.vertices(self._name, data)
        if V is None:
            return height_map
        if self._gradients is None:
            self._gradients = MovedGradients(self._ripples[self._name].rest)
        return MovedHeightMap(self._gradients(np.asarray(height_map), V), V)
