"""A scalar field on a target, shown in colours."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.render.visuals.looks import Look
from ripple_sim.solver.errors import RippleError

# What the light falls on under the colours: its shadows are all that is kept of it.
UNDER_COLORS = Look(color=(0.81, 0.81, 0.81), roughness=0.8)

_FIELD, _COLORS = 12, 13  # texture units, as in shaders/annotation.glsl


class FieldTexture:
    """The field's values and their colours on the GPU; the shader's part is `annotation.glsl`.

    Parameters
    ----------
    ctx : OwnedObjects
    width : int
        Texels N + 2 along an edge of the padded faces.
    colors : array of uint8, shape [k, 3]
        sRGB, from the least to the greatest value.
    """

    def __init__(self, ctx: OwnedObjects, width: int, colors: NDArray[np.uint8]) -> None:
        self._shape = (6, width, width)
        self._values = ctx.texture_array((width, width, 6), 1, dtype="f4")
        self._colors = ctx.texture((len(colors), 1), 3, np.ascontiguousarray(colors).tobytes(), alignment=1)
        for texture in (self._values, self._colors):
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        self.set(np.zeros(self._shape, np.float32), 1.0)

    def set(self, values: NDArray[np.float32], limit: float) -> None:
        """Take in values, [6, N + 2, N + 2]; the colours reach from -limit to limit."""
        if values.shape != self._shape:
            raise RippleError(
                f"the field has shape {list(values.shape)}; valid is {list(self._shape)}: six faces padded by one texel"
            )
        if not (np.isfinite(limit) and limit > 0):
            raise RippleError(f"the field's limit is {limit!r}; valid is a positive, finite number")
        self._values.write(np.ascontiguousarray(values, dtype=np.float32))
        self._limit = float(limit)

    def use(self, program: moderngl.Program) -> None:
        """Bind everything for a draw call."""
        self._values.use(_FIELD)
        self._colors.use(_COLORS)
        program["field_limit"] = self._limit
