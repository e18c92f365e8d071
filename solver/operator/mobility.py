"""The mobility of a surface: where sources may move it, and the parts that float freely.

A part that floats freely has a mean height of its own that nothing pulls back.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..kernel import Bools, Floats, Ints, Ints32
from ..mesh.topology import labels
from ..texels.stencil import Stencil, stiffness_matrix
from .bending import Bending, joins_neighbours
from .curvatures import Curvatures


@dataclasses.dataclass(frozen=True, eq=False)
class Mobility:
    """The part of a surface that sources may move; it stays as at rest while the surface moves.

    Parameters are as of `WaveOperator`. Everything is worked out when it is first asked for.
    """

    stencil: Stencil
    stiffness: Floats
    bending: Bending | Curvatures | None
    fixed: Bools | None
    grip: Floats | None
    density: Floats | None

    @functools.cached_property
    def free(self) -> Bools:
        """Texels that are not clamped, [C, n, n]."""
        return np.ones(self._shape, bool) if self.fixed is None else ~self.fixed

    @functools.cached_property
    def movable(self) -> Bools:
        """Texels that sources may move, [C, n, n]: free ones that something pulls back.

        All free texels, where nothing pulls anywhere.
        """
        pulled = (self.stencil.absolute_sums() > 0) | (self.stiffness > 0)
        if self.bending is not None:
            pulled |= self.bending.rigidity > 0
        movable = pulled & self.free
        return movable if movable.any() else self.free

    @functools.cached_property
    def anchored(self) -> Bools:
        """Free texels that a link ties to clamped ones, [C, n, n]."""
        tied = self.stencil(self.free.astype(np.float64)) != 0
        if self.bending is not None:
            tied |= self.bending.ties(self.free)
        return tied & self.free

    @functools.cached_property
    def source_share(self) -> Floats:
        """Share of a source that sets each texel in motion, [C, n, n].

        What lies below the surface takes the rest.
        """
        return np.where(self.movable, 1.0 if self.grip is None else self.grip, 0.0)

    @functools.cached_property
    def inverse_density(self) -> Floats:
        """Greatest density over the density of each texel, [C, n, n].

        A pressure moves a texel so many times more than the heaviest one.
        """
        if self.density is None:
            return np.ones(self._shape)
        return self.density.max() / self.density

    @functools.cached_property
    def response(self) -> Floats:
        """How the surface moves under a pressure that acts everywhere, [C, n, n].

        It is 1 everywhere on a surface that is alike everywhere.
        """
        return self.source_share * self.inverse_density

    @functools.cached_property
    def parts(self) -> Ints32 | None:
        """Number of the part to which each texel belongs, [C, n, n]; None where there is only one.

        Texels belong together where something joins them. Within each part of the mesh, all texels
        that a spring or a clamp holds count as one part, however zero wave speeds cut them up: the
        springs and clamps bring them back to where they were. Texels that are not movable are
        rigid, and may belong to any part.
        """
        topology = self.stencil.topology
        part_of_chart = self._part_of_chart
        bending_joins = self.bending is not None and self.bending.joins_all
        if joins_neighbours(self.stencil) or bending_joins:
            if not part_of_chart.any():
                return None
            charts = np.broadcast_to(part_of_chart[:, None, None], topology.shape)
            return np.ascontiguousarray(charts, np.int32)

        part = connected_components(self._graph(), directed=False)[1].astype(np.int64)
        held_texels = ((self.stiffness > 0) | self.anchored).reshape(-1)
        is_held = np.bincount(part, held_texels) > 0
        # held parts get the number of their part of the mesh, after the numbers of all other parts
        texels_a_chart = topology.texel_count // len(part_of_chart)
        held_number = part.max() + 1 + np.repeat(part_of_chart, texels_a_chart)
        part = np.where(is_held[part], held_number, part)
        movable = self.movable.reshape(-1)
        names, number = np.unique(part[movable], return_inverse=True)
        if len(names) <= 1:
            return None

        # rigid texels do not break up a chart: they get the highest number on it
        part[:] = -1
        part[movable] = number
        charts = part.reshape(len(part_of_chart), -1)
        highest = charts.max(axis=1, keepdims=True).clip(0)
        filled = np.where(charts < 0, highest, charts)
        return filled.astype(np.int32).reshape(topology.shape)

    @functools.cached_property
    def keeps_volume(self) -> Bools:
        """Whether each part keeps its volume by default, [p]: it is closed, or nothing holds it.

        A closed surface encloses an incompressible body, with any springs or clamps. An open
        one encloses nothing. Its mean height is kept where nothing else would stop it: no rim,
        clamp or spring.
        """
        part = np.zeros(self._shape, np.int32) if self.parts is None else self.parts
        is_open_chart = (self.stencil.topology.glued[..., 0] < 0).any(axis=1)
        is_open = np.bincount(self._part_of_chart, is_open_chart) > 0
        open_texels = is_open[self._part_of_chart][:, None, None] & self.movable
        held_texels = ((self.stiffness > 0) | self.anchored) & self.movable
        has_open_texel = np.bincount(part.reshape(-1), open_texels.reshape(-1)) > 0
        has_held_texel = np.bincount(part.reshape(-1), held_texels.reshape(-1)) > 0
        return ~(has_open_texel & has_held_texel)

    @property
    def _shape(self) -> tuple[int, int, int]:
        """Shape of a field, (C, n, n)."""
        return self.stencil.topology.shape

    @functools.cached_property
    def _part_of_chart(self) -> Ints:
        """Part of the mesh to which each chart belongs, [C], from 0."""
        glued = self.stencil.topology.glued
        chart, side = np.nonzero(glued[..., 0] >= 0)
        return labels(np.stack([chart, glued[chart, side, 0]], axis=1), len(glued))

    def _graph(self) -> csr_array:
        """Texels that a link or the bending joins, as a matrix [T, T]."""
        graph = abs(stiffness_matrix(self.stencil))
        if self.bending is not None:
            graph = csr_array(graph + self.bending.graph)
        graph.eliminate_zeros()
        return graph
