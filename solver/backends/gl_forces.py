"""Forces beside tension and stiffness on the GPU: viscous ones, and those of bending."""

from __future__ import annotations

import moderngl
import numpy as np

from ..gl import GLContext
from ..operator.wave_operator import WaveOperator
from .gl_dispatch import Dispatch
from .gl_fields import FieldLayout, LinkBuffers
from .gl_stencil import StencilBuffer


class ExtraForces:
    """The forces that need stencils of their own, gathered in a field before a substep's kick.

    Attributes
    ----------
    field : moderngl.Buffer or None
        The sum of these forces; None for a material without any.
    """

    def __init__(self, gl: GLContext, fields: FieldLayout, dispatch: Dispatch, operator: WaveOperator) -> None:
        self._gl, self._fields, self._dispatch = gl, fields, dispatch
        self.field: moderngl.Buffer | None = None
        self._viscous: StencilBuffer | None = None
        self._laplace: StencilBuffer | None = None
        if operator.viscous_stencil is not None:
            self._viscous = StencilBuffer(gl, fields, dispatch, operator.viscous_stencil)
            self._apply_viscous = dispatch.block_shader("apply")
        if operator.laplace_stencil is not None and operator.rigidity is not None:
            self._laplace = StencilBuffer(gl, fields, dispatch, operator.laplace_stencil)
            self._rigidity, self._moment = fields.upload(operator.rigidity), fields.zeros()
            self._apply_rigidity = dispatch.block_shader("apply", FACTOR=1)
            added = {"ADD": 1} if self._viscous else {}
            self._subtract_laplace = dispatch.block_shader("apply", SUBTRACT=1, **added)
        if self._viscous or self._laplace:
            self.field = fields.zeros()
        self._irregular = dispatch.shader("irregular", KICK=0)
        self._link(operator)

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        if self._viscous and operator.viscous_stencil is not None:
            self._viscous.write(operator.viscous_stencil, operator.mass)
        if self._laplace and operator.laplace_stencil is not None and operator.rigidity is not None:
            self._laplace.write(operator.laplace_stencil, operator.mass)
            self._fields.write(self._rigidity, operator.rigidity.astype(np.float32))
        self._link(operator)

    def gather(self, height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
        """Write the forces at a height, whose halo is filled, and a velocity."""
        if self.field is None:
            return
        dispatch = self._dispatch
        if self._viscous:
            dispatch.fill_halo(velocity)
            dispatch.bind(velocity, self.field, None, self._viscous.buffer)
            dispatch.run_blocks(self._apply_viscous)
            self._apply_links(self._viscous_links, velocity, self.field)
        if self._laplace:
            dispatch.bind(height, self._moment, None, self._laplace.buffer, self._rigidity)
            dispatch.run_blocks(self._apply_rigidity)
            self._apply_links(self._moment_links, height, self._moment)
            dispatch.fill_halo(self._moment)
            dispatch.bind(self._moment, self.field, None, self._laplace.buffer)
            dispatch.run_blocks(self._subtract_laplace)
            self._apply_links(self._bending_links, self._moment, self.field)

    def _link(self, operator: WaveOperator) -> None:
        """Upload the links at irregular vertices."""
        ones = np.ones_like(operator.mass)
        if self._viscous:
            self._viscous_links = LinkBuffers(self._gl, self._fields, self._viscous.irregular, ones)
        if self._laplace and operator.rigidity is not None:
            self._moment_links, self._bending_links = (
                LinkBuffers(self._gl, self._fields, self._laplace.irregular, factors)
                for factors in (operator.rigidity, -ones)
            )

    def _apply_links(self, links: LinkBuffers, field: moderngl.Buffer, result: moderngl.Buffer) -> None:
        if links.count:
            self._irregular["count"] = links.count
            self._dispatch.bind(field, result, None, links.texels, links.links)
            self._dispatch.run_list(self._irregular, links.count)
