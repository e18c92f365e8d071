"""Forces that are held: where something keeps pressing on the surface."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray


@dataclasses.dataclass(eq=False)
class Load:
    """Constant forces on some texels.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices, ascending, each once.
    forces : float64 [k]
        [N], positive outwards.
    uploaded : bool
        Whether the backend holds this very load.
    """

    texels: NDArray[np.int64]
    forces: NDArray[np.float64]
    uploaded: bool = False

    @classmethod
    def none(cls) -> Load:
        """No force anywhere."""
        return cls(np.zeros(0, np.int64), np.zeros(0))

    def plus(self, texels: NDArray[np.int64], forces: NDArray[np.float64]) -> Load:
        """Add forces to it."""
        merged, where = np.unique(np.concatenate([self.texels, texels]), return_inverse=True)
        total = np.zeros(len(merged))
        np.add.at(total, where, np.concatenate([self.forces, forces]))
        return Load(merged, total)
