"""The resolution that suits a target: fine enough for what touches it, coarse enough for the time step."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver import Material

from .model import CoupledModel
from .suited import Extent, heaviest

LEAST, USUAL, MOST = 32, 96, 256
_STEP = 16

# A footprint's radius is to hold so many texels, and a physics step is to take at most so many substeps.
_TEXELS, _SUBSTEPS = 4.0, 4.0

# Stable time step over the time that a wave takes from texel to texel, on meshes with limbs (0.29 to 0.65 on the meshes
# tried), by which the operator's largest eigenvalue is (2 c / (0.35 d))^2 at a mean spacing d.
_STABLE = 0.35


def suited_resolution(coupled: CoupledModel, geom: int, extent: Extent, material: Material) -> int:
    """Texels along a chart's side, a multiple of 16 from 32 to 256.

    From 96 on, as many as put four texels into the footprint of what touches the target; but no more than can be
    stepped in four substeps to a physics step, as far as that can be told before the atlas is there.
    """
    spacing = np.sqrt(extent.area / 6)  # times resolution
    _, footprint = heaviest(coupled, geom)
    resolved = _TEXELS * spacing / footprint if 0 < footprint < np.inf else 0.0
    n = int(np.clip(_STEP * np.ceil(resolved / _STEP), USUAL, MOST))
    while n > LEAST and _substeps(material, spacing / n, coupled.model.opt.timestep) > _SUBSTEPS:
        n -= _STEP
    return n


def _substeps(material: Material, spacing: float, timestep: float) -> float:
    """Substeps of a physics step at a spacing of the texels [m]."""
    speed, bending, viscosity, stiffness = (
        float(np.max(np.asarray(getattr(material, name), dtype=np.float64)))
        for name in ("speed", "bending", "viscosity", "stiffness")
    )
    eigenvalue = (2 / (_STABLE * spacing)) ** 2
    wave = speed**2 * eigenvalue + bending * eigenvalue**2 + stiffness
    viscous = viscosity * eigenvalue
    return timestep * (viscous + np.sqrt(viscous**2 + 4 * wave)) / 4
