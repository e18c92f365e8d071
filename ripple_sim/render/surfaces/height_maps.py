"""The height-map textures of all targets, for any pass."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.contract import Unit
from ripple_sim.render.gpu.resources import Resources

LAYERS = 6  # of one target: a face each


class HeightMapTextures:
    """A texture array with six layers a target. All are as wide as the widest height map; others fill a corner.

    Parameters
    ----------
    resources : Resources
    resolutions : sequence of int
        Texels N along an edge of each target's faces, without the halo.
    """

    def __init__(self, resources: Resources, resolutions: Sequence[int]) -> None:
        width = max(resolutions, default=0) + 2
        self._texture = resources.texture_array((width, width, LAYERS * max(len(resolutions), 1)), 4, dtype="f4")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = False

    def write(self, first_layer: int, height_map: NDArray[np.float32]) -> None:
        """Replace a target's height map, [6, N + 2, N + 2, 4]."""
        layers, height, width, _ = height_map.shape
        data = np.ascontiguousarray(height_map, dtype=np.float32)
        self._texture.write(data, viewport=(0, 0, first_layer, width, height, layers))

    def bind(self) -> None:
        """Bind the texture for the shaders."""
        self._texture.use(Unit.HEIGHT_MAPS)
