"""Compute shaders of the waves: compiled for a layout of fields, bound to buffers, and run over blocks or lists."""

from __future__ import annotations

import moderngl

from ..gl import GLContext
from .gl_fields import EIGHT, FieldLayout

# Rows that one thread walks up, and threads of a group, in eights of columns and in blocks of rows (block.glsl). A
# software driver has few threads and reads on where the last row ended; a GPU wants many.
_SOFTWARE_BLOCK, _HARDWARE_BLOCK = (64, (8, 1)), (4, (8, 8))

# Threads of a group that works through a list.
_LIST_GROUP = 64


class Dispatch:
    """Runs the shaders in `shaders/` on fields of one layout."""

    def __init__(self, gl: GLContext, fields: FieldLayout) -> None:
        self._gl = gl
        self._fields = fields
        self._rows, self._group = _SOFTWARE_BLOCK if gl.software else _HARDWARE_BLOCK
        self._halo = self.shader("halo")

    def shader(self, name: str, **defines: float) -> moderngl.ComputeShader:
        """A shader that runs over a list."""
        return self._gl.shared_compute_shader(
            "ripple_sim.solver.backends.shaders", name, LIST_GROUP=_LIST_GROUP, **defines
        )

    def block_shader(self, name: str, **defines: int) -> moderngl.ComputeShader:
        """A shader that walks up blocks of the fields, see block.glsl."""
        fields, (columns, rows) = self._fields, self._group
        strips = {"N": fields.n, "WIDTH": fields.width, "STRIDE": fields.stride, "FIELD": fields.eights}
        block = {"ROWS": self._rows, "GROUP_COLUMNS": columns, "GROUP_ROWS": rows}
        return self.shader(name, **strips, **block, **defines)

    def bind(self, *buffers: moderngl.Buffer | None) -> None:
        """Bind buffers to 0, 1, 2 ..., in the order in which the shader declares them; None leaves out a binding."""
        for binding, buffer in enumerate(buffers):
            if buffer is not None:
                buffer.bind_to_storage_buffer(binding)

    def run_blocks(self, shader: moderngl.ComputeShader) -> None:
        """Run a block shader over the whole fields."""
        columns, rows = self._group
        fields = self._fields
        shader.run(-(-fields.width // (EIGHT * columns)), -(-fields.n // (self._rows * rows)), fields.strips)
        self._gl.barrier()

    def run_groups(self, shader: moderngl.ComputeShader, count: int) -> None:
        """Run so many groups of threads."""
        shader.run(count)
        self._gl.barrier()

    def run_list(self, shader: moderngl.ComputeShader, count: int) -> None:
        """Run a shader over a list of so many entries."""
        shader.run(-(-count // _LIST_GROUP))
        self._gl.barrier()

    def fill_halo(self, field: moderngl.Buffer) -> None:
        """Fill the halo of a field."""
        count = self._fields.halo_count
        if count:
            self.bind(field, self._fields.halo_pairs)
            self._halo["count"] = count
            self.run_list(self._halo, count)
