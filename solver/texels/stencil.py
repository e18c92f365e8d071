"""The symmetric nine-point stencil of a texel mesh, with its irregular links.

Layout. A stencil's weights are [C, 4, n + 1, n + 1]: those of the links of place (r, c) of a chart with halo to the
east (r, c)-(r, c + 1), north (r, c)-(r + 1, c), north-east (r, c)-(r + 1, c + 1), and its other diagonal
(r, c + 1)-(r + 1, c). A link that crosses a glued side is stored on both charts, with the same value to the last bit.
Links to places beyond a fixed rim, where heights are 0, tie the last texels down; a free rim has none.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, kernel
from .irregular import IrregularLinks, gather_links
from .links import rim_ties
from .topology import TexelTopology


@dataclasses.dataclass(frozen=True, eq=False)
class Stencil:
    """Link weights w of a symmetric operator: the sum over links of w (h_j - h_i) is its value at texel i.

    Attributes
    ----------
    topology : TexelTopology
    weights : float64 [C, 4, n + 1, n + 1]
        Of the nine-point stencil, see the module.
    irregular : IrregularLinks or None
        The links beyond the nine points.
    """

    topology: TexelTopology
    weights: NDArray[np.float64]
    irregular: IrregularLinks | None = None

    def __call__(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum over the links of w (h_j - h_i) at every texel of a field, float64 [C, n, n]."""
        result = np.empty(self.topology.shape)
        _gather(self.weights, self.topology.with_boundary(field), result)
        if self.irregular is not None:
            gather_links(self.irregular, field.reshape(-1), result.reshape(-1))
        return result

    def scaled(self, factor: float) -> Stencil:
        """The same with all weights multiplied by a factor."""
        links = self.irregular
        if links is not None:
            links = links._replace(weights=factor * links.weights)
        return Stencil(self.topology, factor * self.weights, links)

    def absolute_sums(self) -> NDArray[np.float64]:
        """Sum of |w| over the links that meet in each texel, half of |w| for those to a fixed rim, [C, n, n].

        Twice that is Gershgorin's bound: the other end of a link to a rim does not move.
        """
        n, sums = self.topology.shape[1], np.zeros(self.topology.shape)
        for link, down, left, _, _ in (*_SIDES, *_DIAGONALS):
            sums += np.abs(self.weights[:, link, 1 + down : n + 1 + down, 1 + left : n + 1 + left])
        if self.topology.fixed_rim:
            texels, ties = rim_ties(self.topology)
            np.subtract.at(sums.reshape(-1), texels, np.abs(self.weights.reshape(-1)[ties]) / 2)
        if self.irregular is not None:
            sums.reshape(-1)[self.irregular.texels] += np.add.reduceat(
                np.abs(self.irregular.weights), self.irregular.begins[:-1]
            )
        return sums

    def fastest(self, mass: NDArray[np.float64]) -> float:
        """Gershgorin's bound of the largest eigenvalue over a lumped mass [C, n, n]."""
        return float((self.absolute_sums() * 2 / mass).max())


# link, the place from which it starts relative to the texel, and its other end
_SIDES = ((0, 0, 0, 0, 1), (0, 0, -1, 0, -1), (1, 0, 0, 1, 0), (1, -1, 0, -1, 0))
_DIAGONALS = ((2, 0, 0, 1, 1), (2, -1, -1, -1, -1), (3, -1, 0, -1, 1), (3, 0, -1, 1, -1))


@kernel
def _gather(w: Floats, h: Floats, out: Floats) -> None:
    """Sum of weight (h_j - h_i) over the stencil; h has a halo."""
    n = out.shape[1]
    for chart in range(len(out)):
        for r in range(1, n + 1):
            for c in range(1, n + 1):
                total = 0.0
                for links in (_SIDES, _DIAGONALS):
                    for link, i, j, dr, dc in links:
                        total += w[chart, link, r + i, c + j] * (h[chart, r + dr, c + dc] - h[chart, r, c])
                out[chart, r - 1, c - 1] = total
