"""Height maps on the GPU: a texture array with one layer a target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.chart_page import ChartPage
from ripple_sim.solver.waves.height_map import DeviceHeightMap

from .contract import Unit
from .resources import Resources


class MovedHeightMap(NamedTuple):
    """Height map of a surface that has moved.

    Attributes
    ----------
    height_map : float32 [C, n + 2, n + 2, 4]
        Height map with gradients on the moved surface; see `MovedGradients`.
    V : float64 [vertex_count, 3]
        Positions of the vertices of the target's mesh, in its frame [m].
    """

    height_map: NDArray[np.float32]
    V: NDArray[np.float64]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        return np.asarray(self.height_map, dtype=dtype)


# A height map in the host's memory, or on the GPU if the waves are computed there.
AnyHeightMap: TypeAlias = NDArray[np.float32] | DeviceHeightMap | MovedHeightMap


class HeightMapTextures:
    """A texture array with one layer a target, which contains the page of its charts.

    Layers are as large as the largest page.

    Parameters
    ----------
    pages : sequence of ChartPage
        Pages of the targets.
    """

    def __init__(self, resources: Resources, pages: Sequence[ChartPage]) -> None:
        self._pages = pages
        width = max((page.size[0] for page in pages), default=1)
        height = max((page.size[1] for page in pages), default=1)
        layers = max(len(pages), 1)
        self._texture = resources.clamped_texture((width, height, layers), 4, dtype="f4")

    def write(self, layer: int, height_map: NDArray[np.float32] | DeviceHeightMap) -> float:
        """Replace a target's height map, [C, n + 2, n + 2, 4]; return its greatest |height| [m]."""
        if isinstance(height_map, DeviceHeightMap):
            return height_map.fill(self._texture, layer)
        write_page(self._texture, self._pages[layer], layer, height_map)
        return float(np.abs(height_map[..., 3]).max())

    def bind(self) -> None:
        """Bind the texture for the shaders."""
        self._texture.use(Unit.HEIGHT_MAPS)


def write_page(
    texture: moderngl.TextureArray, page: ChartPage, layer: int, charts: NDArray[np.float32]
) -> None:
    """Write charts with halo, [C, n + 2, n + 2, ...], to the page in a layer of a texture array."""
    for first in range(0, len(charts), page.columns):
        # a row of charts at once, since each write takes time
        row = np.ascontiguousarray(
            np.concatenate(charts[first : first + page.columns], axis=1), dtype=np.float32
        )
        x, y = page.corner(first)
        texture.write(row, viewport=(x, y, layer, row.shape[1], page.block, 1))
