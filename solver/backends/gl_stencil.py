"""A stencil in a storage buffer, which follows a surface that moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..texels.moved_stencil import MovedStencil
from ..texels.stencil import Stencil
from .gl_dispatch import Dispatch
from .gl_fields import FieldLayout
from .gl_stiffness import DeviceStiffness


class StencilBuffer:
    """The nine-point stencil as the wave step reads it, and the irregular links.

    Attributes
    ----------
    buffer : moderngl.Buffer
    irregular : IrregularLinks or None
    """

    def __init__(self, gl: GLContext, fields: FieldLayout, dispatch: Dispatch, stencil: Stencil) -> None:
        self._gl, self._fields, self._dispatch = gl, fields, dispatch
        self.buffer, self.irregular = fields.upload_stencil(stencil), stencil.irregular
        self._device: DeviceStiffness | None = None

    @property
    def on_device(self) -> bool:
        """Whether it has been made on the GPU."""
        return self._device is not None

    def write(self, stencil: Stencil, mass: NDArray[np.float64]) -> None:
        """Take over another stencil of the same topology: made on the GPU where that can be, else uploaded.

        A software driver's shaders run on the processor's own cores, where the CPU's loops take a fifth of the time.
        """
        if not self._gl.software and isinstance(stencil, MovedStencil) and DeviceStiffness.suits(stencil):
            if self._device is None:
                self._device = DeviceStiffness(self._gl, self._fields, self._dispatch, stencil, mass)
            self.irregular = self._device.write(stencil, self.buffer)
        else:
            self._fields.write_stencil(self.buffer, stencil)
            self.irregular = stencil.irregular
