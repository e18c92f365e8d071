"""A field of texels that stays on the GPU: nothing is read back unless it is asked for."""

from __future__ import annotations

import functools
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext

_GROUP = 256
_SHADERS = "ripple_sim.solver"


class DeviceField:
    """A frozen field [C, n, n] in a storage buffer, made by `gathered` or `blend`; `numpy.asarray` reads it back.

    Attributes
    ----------
    gl : GLContext
    shape : (C, n, n)
    buffer : moderngl.Buffer
        float32, chart by chart and row by row.
    """

    def __init__(
        self, gl: GLContext, shape: tuple[int, ...], shader: str, *sources: moderngl.Buffer, **uniforms: float
    ):
        self.gl, self.shape = gl, shape
        count = int(np.prod(shape))
        with gl as ctx:
            self.buffer: moderngl.Buffer = ctx.buffer(reserve=4 * count)
            self._peak = ctx.buffer(bytes(4))
            program = gl.shared_compute_shader(_SHADERS, f"backends/shaders/{shader}", GROUP=_GROUP)
            program["count"] = count
            for name, value in uniforms.items():
                program[name] = value
            for binding, buffer in enumerate((self.buffer, self._peak, *sources)):
                buffer.bind_to_storage_buffer(binding)
            program.run(-(-count // _GROUP))
            ctx.memory_barrier()
            self._fence = gl.put_fence()

    @classmethod
    def gathered(
        cls, gl: GLContext, shape: tuple[int, ...], addresses: moderngl.Buffer, *fields: moderngl.Buffer
    ) -> DeviceField:
        """One field, or the sum of two, by the address of every texel in them."""
        first, second = fields[0], fields[-1]
        return cls(gl, shape, "gather", addresses, first, second, share=float(len(fields) - 1))

    def blend(self, other: DeviceField, share: float) -> DeviceField:
        """The field a share of the way to another."""
        return DeviceField(self.gl, self.shape, "blend", self.buffer, other.buffer, share=share)

    @functools.cached_property
    def peak(self) -> float:
        """The largest size of a value; NaN if one is not a number. Waits until the field is there, for nothing else."""
        self.gl.wait_for(self._fence)
        with self.gl:
            return float(np.frombuffer(self._peak.read(), np.float32)[0])

    def read(self) -> NDArray[np.float32]:
        """A copy in the host's memory."""
        with self.gl:
            self.gl.wait()
            return np.frombuffer(self.buffer.read(), np.float32).reshape(self.shape).copy()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        return self.read().astype(np.float32 if dtype is None else dtype, copy=False)
