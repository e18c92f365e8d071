"""Baselines: difference stencils of other methods, to compare the finite elements with.

The formulas give accelerations without masses. Here a texel has a mass, so that a baseline counts
with one area and one density for all texels.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats
from ..texels.stencil import LINK_ENDS, Stencil, crossing_links, link_lengths
from ..texels.texel_mesh import TexelMesh

# Names of the baselines; `build_operator` says what each of them is.
BASELINES = ("paper", "uncorrected", "dynamic-paint")


class Discretisation(NamedTuple):
    """How a method turns fields on the texels into masses and link weights.

    Attributes
    ----------
    areas : float64 [C, n, n]
        Area that belongs to each texel [m^2].
    density : float64 [C, n, n]
        [kg/m^2].
    stencil : callable
        From a coefficient [C, n, n] to the stencil of -div(coefficient grad).
    """

    areas: Floats
    density: Floats
    stencil: Callable[[Floats], Stencil]


def baseline(kind: str, texels: TexelMesh, areas: Floats, density: Floats) -> Discretisation:
    """The baseline of a name in `BASELINES`, with the mean of the areas and of the density."""
    even_areas = np.full_like(areas, areas.mean())
    even_density = np.full_like(density, density.mean())
    stencil = functools.partial(_difference_stencil, texels, kind, even_areas[0, 0, 0])
    return Discretisation(even_areas, even_density, stencil)


def _difference_stencil(
    texels: TexelMesh, kind: str, area: float, coefficient: NDArray[np.float64]
) -> Stencil:
    """Link weights area coefficient / distance^2, without links beyond the nine points."""
    lengths = link_lengths(texels.topology, texels.halo_positions)
    if kind != "dynamic-paint":
        lengths[:, 2:] = np.inf  # no diagonals
    if kind == "uncorrected":
        finite = np.isfinite(lengths)
        lengths[finite] = lengths[finite].mean()
    lengths[lengths == 0] = np.inf
    around = texels.topology.with_halo(coefficient)
    means = np.stack([(around[a] + around[b]) / 2 for a, b in LINK_ENDS], axis=1)
    weights = area * means / lengths**2
    crossing_links(texels.topology).level(weights)
    return Stencil(texels.topology, weights)
