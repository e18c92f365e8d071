"""The materials and resolutions of all targets, with what is not given chosen by the model."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

from ripple_sim.solver import Material

from .geoms import find_target
from .model import CoupledModel
from .soft import SoftSurface
from .soft_ids import is_soft
from .suited import Extent, suited_material, suited_soft_material
from .suited_resolution import suited_resolution
from .target_mesh import target_mesh

_SOFT = 64  # resolution of flexes and skins


def suited_targets(
    model: mujoco.MjModel, materials: Mapping[str, Material], resolutions: Mapping[str, int | None]
) -> tuple[dict[str, Material], dict[str, int]]:
    """Materials without unset coefficients, and resolutions, by the names of the targets.

    Raises
    ------
    MeshError
        If a target's mesh cannot ripple.
    """
    suited, texels = dict(materials), {name: n for name, n in resolutions.items() if n is not None}
    geoms = {name: find_target(model, name) for name in materials}
    for name, target in list(geoms.items()):
        if is_soft(model, target):
            surface = SoftSurface(model, geoms.pop(name))
            suited[name] = suited_soft_material(model, Extent.of(surface.mesh), surface.mass, materials[name])
            texels.setdefault(name, _SOFT)
    left = [name for name in geoms if materials[name].unset or name not in texels]
    if not left:
        return suited, texels
    coupled = CoupledModel(model, geoms.values())
    for name in left:
        extent = Extent.of(target_mesh(model, geoms[name]))
        suited[name] = suited_material(coupled, geoms[name], extent, materials[name])
        if name not in texels:
            texels[name] = suited_resolution(coupled, geoms[name], extent, suited[name])
    return suited, texels
