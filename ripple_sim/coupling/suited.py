"""What suits a target where the user does not say: the material's coefficients, and the resolution.

The resolution that suits a target: fine enough for what touches it, coarse enough for the time step.

The materials and resolutions of all targets, with what is not given chosen by the model.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from ripple_sim.solver import Material, Mesh
from ripple_sim.solver.operator.presets import BOUNCE, damping_for, narrow_stiffness, stiffness_after, stiffness_under

from .geoms import find_target
from .model import CoupledModel
from .soft import SoftSurface, is_soft
from .target_mesh import target_mesh

# Waves cross the target in the first time and fall to a tenth in the second [s].
_CROSSING, _DECAY = 0.25, 1.5

# MuJoCo's default, in place of that of a geom without a mass: those of the world have none [kg/m^3].
_DENSITY = 1000.0

# By this share of its radius a typical hit may dent a target, and a body at rest. Dents of more than a quarter are
# warned of; those seen are half of what the estimate allows, which takes the whole impulse in the shortest time.
_HIT, _REST = 0.5, 0.1

# A ball has the radius 3 V / A and a tube 2 V / A; a plate has half the thickness V / A.
_RADIUS = 1.5

# How long most of a contact's impulse takes, over the time constant of its `solref`.
_PULSE = 0.4

# Footprints smaller than this share of the target's size count as of this size.
_FOOTPRINT = 0.025

# A stiffness beyond (this / time step)^2 would take more substeps than the waves.
_STIFFEST = 4.0


class Extent(NamedTuple):
    """How large a target is: its longest extent [m], its area [m^2] and its volume [m^3]."""

    size: float
    area: float
    volume: float

    @classmethod
    def of(cls, mesh: Mesh) -> Extent:
        """Extent of a mesh; where that is open, as if its rims were closed from the middle."""
        a, b, c = np.moveaxis((mesh.V - mesh.V.mean(axis=0))[mesh.F], 1, 0)
        area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
        volume = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6))
        size = float(np.ptp(mesh.V, axis=0).max())
        return cls(size, area, max(volume, 1e-3 * size * area))


def suited_material(coupled: CoupledModel, geom: int, extent: Extent, material: Material) -> Material:
    """The material with what it leaves to the model chosen; what is given stays, all of it where the density is.

    - speed: waves cross the target in a quarter of a second, or as fast as a body is that has fallen from a height of
      the target's size, which is faster on targets smaller than 1 m;
    - damping: they fall to a tenth in 1.5 s;
    - density: the mass of the target's body over the area of the target; of a geom without a mass, 1000 kg/m^3 times
      its volume over its area;
    - stiffness: (16 c / size)^2, or more: under the heaviest body that can touch the target, at rest, the surface sinks
      by a tenth of the target's radius at most, and a fall from a height of the target's size leaves a dent of about a
      quarter.

    Parameters
    ----------
    coupled : CoupledModel
    geom : int
        The target.
    extent : Extent
        Of its surface.
    material : Material
    """
    if not material.unset:
        return material
    fall = _fall(coupled.model, extent)
    speed = max(extent.size / _CROSSING, fall) if "speed" in material.unset else _greatest(material.speed)
    density = _density(coupled.model, geom, extent)
    suited = {
        "speed": speed,
        "damping": damping_for(_DECAY),
        "stiffness": _stiffness(coupled, geom, extent, speed, density),
        "density": density,
    }
    return dataclasses.replace(material, **{name: suited[name] for name in material.unset})


def suited_soft_material(model: mujoco.MjModel, extent: Extent, mass: float, material: Material) -> Material:
    """The same for a flex or a skin, by its size and the mass of its bodies [kg]: what may hit it is not looked at."""
    if not material.unset:
        return material
    speed = max(extent.size / _CROSSING, _fall(model, extent))
    suited = {
        "speed": speed,
        "damping": damping_for(_DECAY),
        "stiffness": narrow_stiffness(extent.size, speed),
        "density": float(np.clip((mass if mass > 0 else _DENSITY * extent.volume) / extent.area, 1e-12, 1e12)),
    }
    return dataclasses.replace(material, **{name: suited[name] for name in material.unset})


def _density(model: mujoco.MjModel, geom: int, extent: Extent) -> float:
    mass = float(model.body_mass[model.geom_bodyid[geom]])
    density = (mass if mass > 0 else _DENSITY * extent.volume) / extent.area
    return float(np.clip(density, 1e-12, 1e12))


def _stiffness(coupled: CoupledModel, geom: int, extent: Extent, speed: float, density: float) -> float:
    model = coupled.model
    mass, footprint = heaviest(coupled, geom)
    radius = max(footprint, _FOOTPRINT * extent.size)
    depth = _RADIUS * extent.volume / extent.area
    pulse = _PULSE * max(float(coupled.solref[geom, 0]), 2 * model.opt.timestep)
    of = {"radius": radius, "density": density, "speed": speed}
    stiffness = max(
        narrow_stiffness(extent.size, speed),
        stiffness_under(mass * float(np.linalg.norm(model.opt.gravity)), _REST * depth, **of),
        stiffness_after(BOUNCE * mass * _fall(model, extent), _HIT * depth, duration=pulse, **of) if mass else 0.0,
    )
    return float(min(stiffness, (_STIFFEST / model.opt.timestep) ** 2, 1e12))


def _fall(model: mujoco.MjModel, extent: Extent) -> float:
    """Speed of a body that has fallen from a height of the target's size [m/s]; without gravity, a size a second."""
    return float(max(np.sqrt(2 * np.linalg.norm(model.opt.gravity) * extent.size), extent.size))


def heaviest(coupled: CoupledModel, geom: int) -> tuple[float, float]:
    """Mass that the heaviest body that can touch a target brings with it [kg], and its footprint radius [m].

    Of two bodies that both move it is the reduced mass, and a body stands for all that it is joined to. Where nothing
    moves, the mass is 0.
    """
    model = coupled.model
    masses = model.body_subtreemass[model.body_rootid]
    inverse = np.where(model.body_weldid != 0, 1 / np.maximum(masses, 1e-300), 0.0)[model.geom_bodyid]
    total = np.where(coupled.can_collide(geom), inverse + inverse[geom], 0.0)
    reduced = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)
    other = int(reduced.argmax())
    radii = coupled.footprint_radii
    return float(reduced[other]), float(min(radii[geom], radii[other]))


def _greatest(coefficient: object) -> float:
    return float(np.max(np.asarray(coefficient, dtype=np.float64)))


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
