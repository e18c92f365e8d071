"""The height-map textures of all targets, for any pass."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.contract import Unit
from ripple_sim.render.gpu.resources import Resources
from ripple_sim.solver.texels.chart_page import ChartPage


class HeightMapTextures:
    """A texture array with one layer a target: a page of its charts. Layers are as large as the largest page.

    Parameters
    ----------
    resources : Resources
    pages : sequence of ChartPage
        Of the targets.
    """

    def __init__(self, resources: Resources, pages: Sequence[ChartPage]) -> None:
        self._pages = pages
        width, height = (max((page.size[axis] for page in pages), default=1) for axis in range(2))
        self._texture = resources.texture_array((width, height, max(len(pages), 1)), 4, dtype="f4")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = False

    def write(self, layer: int, height_map: NDArray[np.float32]) -> None:
        """Replace a target's height map, [C, n + 2, n + 2, 4]."""
        write_page(self._texture, self._pages[layer], layer, height_map)

    def bind(self) -> None:
        """Bind the texture for the shaders."""
        self._texture.use(Unit.HEIGHT_MAPS)


def write_page(texture: moderngl.TextureArray, page: ChartPage, layer: int, charts: NDArray[np.float32]) -> None:
    """Write charts with halo, [C, n + 2, n + 2, ...], to the page in a layer of a texture array."""
    for chart, texels in enumerate(charts):
        x, y = page.corner(chart)
        data = np.ascontiguousarray(texels, dtype=np.float32)
        texture.write(data, viewport=(x, y, layer, page.block, page.block, 1))
