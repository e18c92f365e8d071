"""A heatmap: one of the solver's fields on a target, in false colours."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import Unit
from ripple_sim.render.height_maps import write_page
from ripple_sim.render.resources import Resources
from ripple_sim.render.visuals.looks import Look
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.texels.texel_atlas import ChartPage

# What is lit under the colours: only its shadows are kept.
UNDER_HEATMAP = Look(color=(0.81, 0.81, 0.81), roughness=0.8)


class HeatmapTexture:
    """A field's values and their colours on the GPU, for heatmap.glsl.

    Parameters
    ----------
    resources : Resources
    page : ChartPage
        Of the target's charts.
    colors : array of uint8, shape [k, 3]
        sRGB, from the least to the greatest value.
    """

    def __init__(self, resources: Resources, page: ChartPage, colors: NDArray[np.uint8]) -> None:
        self._page, self._shape = page, (page.charts, page.block, page.block)
        self._values = resources.texture_array((*page.size, 1), 1, dtype="f4")
        self._colors = resources.texture((len(colors), 1), 3, np.ascontiguousarray(colors).tobytes(), alignment=1)
        for texture in (self._values, self._colors):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        self.set(np.zeros(self._shape, np.float32), 1.0)

    def set(self, values: NDArray[np.float32], limit: float) -> None:
        """Replace the values, [C, n + 2, n + 2]; the colours range from -limit to limit.

        Raises
        ------
        RippleError
            If the shape is another, or the limit is not a positive, finite number.
        """
        if values.shape != self._shape:
            raise RippleError(
                f"the heatmap's values have shape {list(values.shape)}; valid is {list(self._shape)}: charts with a "
                "halo of one texel"
            )
        if not (np.isfinite(limit) and limit > 0):
            raise RippleError(f"the heatmap's limit is {limit!r}; valid is a positive, finite number")
        write_page(self._values, self._page, 0, values)
        self._limit = float(limit)

    def use(self, program: moderngl.Program) -> None:
        """Bind everything for a draw call."""
        self._values.use(Unit.HEATMAP)
        self._colors.use(Unit.HEATMAP_COLORS)
        program["heatmap_limit"] = self._limit
