"""Links beyond the nine-point stencil: the diagonals of the cells round irregular vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel


class IrregularLinks(NamedTuple):
    """Links by the texels in which they end; every link is stored for both of its ends.

    Attributes
    ----------
    texels : int64 [k]
        Flat indices, ascending, each once.
    begins : int64 [k + 1]
        The links of texel i are those from begins[i] to begins[i + 1].
    others : int64 [m]
        The texel at the other end.
    weights : float64 [m]
    """

    texels: Ints
    begins: Ints
    others: Ints
    weights: Floats

    @classmethod
    def of(cls, ends: NDArray[np.int64], weights: NDArray[np.float64]) -> IrregularLinks | None:
        """Sort links [k, 2] with weights [k]; None where there are none."""
        if not len(ends):
            return None
        both, twice = np.concatenate([ends, ends[:, ::-1]]), np.tile(weights, 2)
        order = np.lexsort((both[:, 1], both[:, 0]))
        texels, begins = np.unique(both[order, 0], return_index=True)
        return cls(texels, np.append(begins, len(both)), both[order, 1], twice[order])


NO_LINKS = IrregularLinks(np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0))


@kernel
def gather_links(links: IrregularLinks, field: Floats, out: Floats) -> None:
    """Add the sum over the links of weight (h_j - h_i) to a flat field."""
    for i in range(len(links.texels)):
        t = links.texels[i]
        total = 0.0
        for k in range(links.begins[i], links.begins[i + 1]):
            total += links.weights[k] * (field[links.others[k]] - field[t])
        out[t] += total
