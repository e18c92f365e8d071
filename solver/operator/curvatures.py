"""Bending as a sum of squares of curvatures.

Each texel has three weighed curvatures, each a nine-point difference of the heights. Half the sum
of their squares is the energy, which can therefore never be negative. With R the matrix of
differences, the force is -R^T R h: a first pass takes the curvatures, and a second one sums them up
with the transposed weights.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..kernel import Bools, Floats, Ints
from ..texels.topology import TexelTopology

# Curvatures of a texel.
KINDS = 3

# Neighbours of a texel; a curvature is a difference of their heights and its own.
NEIGHBOURS = 8

# Row and column of the neighbours, from the texel.
STEPS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


def neighbours(topology: TexelTopology) -> Ints:
    """Texels round each texel, in the order of `STEPS`, [8, C, n, n]; -1 where there is none.

    Beyond a rim there is none.
    """
    n = topology.shape[1]
    halo = np.where(topology.rim, -1, topology.halo)
    return np.stack([halo[:, 1 + r : n + 1 + r, 1 + c : n + 1 + c] for r, c in STEPS])


def regular_texels(topology: TexelTopology) -> NDArray[np.bool_]:
    """Texels with eight different neighbours that have them as neighbours too, [C, n, n]."""
    around = neighbours(topology).reshape(NEIGHBOURS, -1)
    count = topology.texel_count
    ordered = np.sort(around, axis=0)
    regular = (ordered[0] >= 0) & (np.diff(ordered, axis=0) > 0).all(axis=0)
    own = np.arange(count)
    # pairs of a texel and a neighbour, and the same pairs seen from the neighbour
    pairs = np.concatenate([own + count * neighbour for neighbour in around])
    reversed_pairs = np.concatenate([neighbour + count * own for neighbour in around])
    regular &= np.isin(reversed_pairs, pairs).reshape(NEIGHBOURS, -1).all(axis=0)
    return regular.reshape(topology.shape)


@dataclasses.dataclass(frozen=True, eq=False)
class Curvatures:
    """Bending of the regular texels inside a plate.

    The bending of irregular texels and of those beside rims is added as links.

    Attributes
    ----------
    topology : TexelTopology
    weights : float64 [3, 8, C, n, n]
        Of curvature k of a texel, the sum over its neighbours of weight (h_neighbour - h) [sqrt(N /
        m)]; 0 where the texel is not one of `regular_texels`.
    rigidity : float64 [C, n, n]
        D [N m].
    """

    topology: TexelTopology
    weights: Floats
    rigidity: Floats

    @functools.cached_property
    def matrix(self) -> csr_array:
        """R [3 T, T], from heights to curvatures."""
        count = self.topology.texel_count
        around = neighbours(self.topology).reshape(NEIGHBOURS, count)
        weights = self.weights.reshape(KINDS, NEIGHBOURS, count)
        kind, step, texel = np.nonzero(weights)
        weight = weights[kind, step, texel]
        row = kind * count + texel
        rows = np.concatenate([row, row])
        columns = np.concatenate([around[step, texel], texel])
        return csr_array(
            (np.concatenate([weight, -weight]), (rows, columns)), shape=(KINDS * count, count)
        )

    @functools.cached_property
    def transposed(self) -> Floats:
        """Weights of curvatures in the force on each texel, [3, 9, C, n, n].

        First those of its neighbours' curvatures, then those of its own.
        """
        count = self.topology.texel_count
        around = neighbours(self.topology).reshape(NEIGHBOURS, count)
        weights = self.weights.reshape(KINDS, NEIGHBOURS, count)
        back = np.zeros((KINDS, NEIGHBOURS + 1, count))
        for step in range(NEIGHBOURS):
            for opposite in range(NEIGHBOURS):
                # the neighbour in this step may see the texel in any other step: charts are turned
                # against each other
                other = around[step]
                meets = (other >= 0) & (around[opposite][other] == np.arange(count))
                back[:, step, meets] += weights[:, opposite, other[meets]]
        # a texel may see the same neighbour twice, beside an irregular vertex: it counts once
        for step in range(NEIGHBOURS):
            for earlier in range(step):
                is_same = (around[step] == around[earlier]) & (around[step] >= 0)
                back[:, step, is_same] = 0.0
        back[:, NEIGHBOURS] = -weights.sum(axis=1)
        return back.reshape(KINDS, NEIGHBOURS + 1, *self.topology.shape)

    def force(self, height: Floats) -> Floats:
        """-R^T R h [N], float64 [C, n, n]."""
        return -(self.matrix.T @ (self.matrix @ height.ravel())).reshape(height.shape)

    @functools.cached_property
    def stiffness(self) -> csr_array:
        """R^T R [N/m], [T, T]."""
        return csr_array(self.matrix.T @ self.matrix)

    def fastest(self, mass: Floats) -> float:
        """Gershgorin's bound of the largest eigenvalue over a lumped mass [C, n, n]."""
        return float((self._pulls / mass.ravel()).max())

    @functools.cached_property
    def _pulls(self) -> Floats:
        """Upper bounds of the sums of absolute values in the rows of R^T R, [T]."""
        size = abs(self.matrix)
        return np.asarray(size.T @ size.sum(axis=1))

    def ties(self, free: Bools) -> Bools:
        """Texels that bend together with one that is not free, [C, n, n]."""
        size = abs(self.matrix)
        return (size.T @ (size @ (~free).ravel().astype(np.float64)) > 0).reshape(free.shape)

    @property
    def joins_all(self) -> bool:
        """Whether all texels of a part of the mesh bend together."""
        return bool((self.rigidity > 0).all())

    @property
    def graph(self) -> csr_array:
        """Texels that are joined, [T, T]."""
        return abs(self.stiffness)
