"""Default coefficients and default resolution of a target, from the model.

Materials are chosen by the bodies that can touch the target, by how far they fall, and by the time
step. Resolutions are fine enough for the bodies that touch the target, and coarse enough for the
time step.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material, Mesh
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.operator.suited_law import (
    BOUNCE,
    FOOTPRINT,
    damping_for,
    density_after,
    density_under,
    narrow_stiffness,
)
from ripple_sim.solver.texels.thickness import half_thickness_at

from .easing import EasingLaw
from .geoms import find_target
from .ids import GeomId, TargetId, geom_id, is_geom
from .model import CoupledModel
from .soft import SoftSurface
from .target_mesh import target_mesh

# Time in which waves cross the target [s].
_CROSSING_TIME = 0.25

# Time in which waves fall to a tenth [s].
_DECAY_TIME = 1.5

# MuJoCo's default density, for geoms without a mass: geoms of the world have none [kg/m^3].
_DEFAULT_DENSITY = 1000.0

# Dents over the target's radius, of a fall and of a body at rest. Dents beyond a quarter of the
# radius are warned of. The estimates are half of what a hard, short hit does, and many times what
# the slow push of a limb does.
_HIT_DENT = 0.085
_REST_DENT = 0.05

# The same dents where forces are eased. The lightest body leaves a ring that is visible once the
# body has left, and sinks in by the second share at rest.
_EASED_HIT_DENT = 0.265
_EASED_REST_DENT = 0.1

# The allowed dent of a body narrower than the least footprint goes with this power of its width.
_NARROW_POWER = 0.3

# Dent over the target's radius up to which forces are taken up, see `EasingLaw`.
_EASED_DENT = 0.12

# The least density over the density for the heaviest body: even lighter bodies are specks.
_MIN_DENSITY_RATIO = 1e-6

# Time that most of a contact's impulse takes, over the time constant of its `solref`.
_PULSE_SHARE = 0.4

# Wave number of the longest wave on a ball, times its size: sqrt(8).
_LONGEST_WAVE_NUMBER = 8**0.5

# Largest product of sqrt(stiffness) and the time step: a swing takes twelve steps or more. Faster
# swings are not resolved, and take up energy from contacts that last a step.
_MAX_PHASE_STEP = 0.5

# Height from which a body falls, over the target's size, at most: bodies higher up wait to be
# dropped.
_MAX_FALL_HEIGHT = 2.0

# Dent of a typical hit over the target's size, and at most over half its usual thickness.
_TYPICAL_DENT = 0.05
_MAX_TYPICAL_DENT = 0.5

# Resolutions that are chosen, in texels along a chart's side: the lowest, the usual, the highest.
LEAST = 32
USUAL = 96
MOST = 256
# Chosen resolutions are multiples of this.
_RESOLUTION_STEP = 16

# Texels along the radius of a footprint.
_FOOTPRINT_TEXELS = 4.0

# Largest number of substeps of the waves in a physics step.
_MAX_SUBSTEPS = 4.0

# Stable time step over the time that a wave takes from texel to texel, on meshes with limbs (0.29
# to 0.65 on the meshes tried), by which the operator's largest eigenvalue is (2 c / (0.35 d))^2 at
# a mean spacing d.
_STABLE_SHARE = 0.35

# Rings of a body are not visible if the surface bears a weight so many times its own.
_MAX_MASS_RATIO = 100.0

# Resolution of flexes and skins, in texels along a chart's side.
_SOFT_RESOLUTION = 64

# A mesh of so many triangles that is no sphere in shape gets this resolution at most, since charts
# take long on it: on a jaco base 3.3 s of processor time at 32, 11.0 s at 48, and no result within
# 120 s at 96.
_MANY_TRIANGLES = 10_000
_INTRICATE_RESOLUTION = 48

# Bounds of a chosen density [kg/m^2] and stiffness [1/s^2], far beyond all real ones.
_MIN_DENSITY = 1e-12
_MAX_DENSITY = 1e12
_MAX_STIFFNESS = 1e12

# Least volume of a target over its area times its longest extent, for surfaces that enclose none.
_MIN_VOLUME_SHARE = 1e-3

# Keeps divisions by an area, a gravity or a mass finite.
_MIN_DIVISOR = 1e-300

# Euler characteristic of a sphere.
_SPHERE_EULER = 2


class Extent(NamedTuple):
    """How large a target is.

    Attributes
    ----------
    size : float
        Its longest extent [m].
    area : float
        [m^2]
    volume : float
        [m^3]
    radius : float
        Half its usual thickness [m].
    """

    size: float
    area: float
    volume: float
    radius: float

    @classmethod
    def of(cls, mesh: Mesh) -> Extent:
        """Extent of a mesh; where that is open, as if its rims were closed from the middle."""
        middle = mesh.V.mean(axis=0)
        a, b, c = np.moveaxis((mesh.V - middle)[mesh.F], 1, 0)
        normals = np.cross(b - a, c - a)
        areas = np.linalg.norm(normals, axis=1) / 2
        area = float(areas.sum())
        volume = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6))
        size = float(np.ptp(mesh.V, axis=0).max())
        normals /= np.maximum(2 * areas, _MIN_DIVISOR)[:, None]
        radii = half_thickness_at(mesh, (a + b + c) / 3 + middle, normals)
        # the median over the area
        order = np.argsort(radii)
        median = order[np.searchsorted(np.cumsum(areas[order]), area / 2)]
        return cls(
            size=size,
            area=area,
            volume=max(volume, _MIN_VOLUME_SHARE * size * area),
            radius=float(radii[median]),
        )


class SuitedMaterial(NamedTuple):
    """A material that suits a target.

    Attributes
    ----------
    material : Material
        Without unset coefficients.
    easing : EasingLaw, optional
        How forces of bodies too heavy for the target are eased; None: they are taken up whole.
    """

    material: Material
    easing: EasingLaw | None = None


def suited_material(
    coupled: CoupledModel,
    geom: GeomId,
    extent: Extent,
    material: Material,
    *,
    can_ease: bool = False,
) -> SuitedMaterial:
    """Choose the coefficients that a material leaves to the model.

    Coefficients that are given stay, and so does a material whose density is given.

    - speed: waves cross the target in a quarter of a second; or, on targets smaller than 1 m, at
      the speed of a body that has fallen from a height of the target's size, which is faster;
    - damping: waves fall to a tenth in 1.5 s;
    - stiffness: (16 c / size)^2, so that dents are narrow and rings run from them; but no more than
      (0.5 / dt)^2, which the time step dt resolves;
    - density: a fall of the heaviest body that can touch the target leaves a dent of less than a
      quarter of the target's radius, and at rest that body sinks by a twentieth at most. Rings are
      then some hundredth of the size high. The fall is from a height of the target's size, or from
      where bodies are above the target, or the target above them, in the model as it begins. Where
      nothing can touch the target, the density is the mass of its body over its area; for a geom
      without a mass, 1000 kg/m^3 times its volume over its area.

    With `can_ease`, the density is for the lightest body that can touch the target and is not
    joined to it, so that its ring is seen; forces are taken up as far as they dent the target by a
    fifth of its radius, see `Easing`.

    Parameters
    ----------
    coupled : CoupledModel
    geom : GeomId
        The target.
    extent : Extent
        Of its surface.
    material : Material
    can_ease : bool
    """
    if not material.unset:
        return SuitedMaterial(material)
    speed, stiffness = _speed_and_stiffness(coupled.model, extent, material)
    density = _density_under(coupled, geom, extent, speed, stiffness)
    if density == 0:
        density = _density(float(coupled.model.body_mass[coupled.model.geom_bodyid[geom]]), extent)
    if not can_ease or _reduced_masses(coupled, geom).max() == 0:
        return SuitedMaterial(_filled_in(material, speed, stiffness, density))
    lightest = lightest_hit(coupled, geom, extent)
    _, footprint = heaviest(coupled, geom)
    if lightest is not None:
        footprint = lightest.footprint
        density_for_lightest = _density_for(
            coupled,
            geom,
            extent,
            lightest,
            speed,
            stiffness,
            dent=_eased_hit_dent(lightest, extent),
            sink=_EASED_REST_DENT * extent.radius,
        )
        density = min(density, max(density_for_lightest, _MIN_DENSITY_RATIO * density))
    easing = EasingLaw.of(
        _EASED_DENT,
        extent.radius,
        radius=max(footprint, FOOTPRINT * extent.size),
        density=density,
        speed=speed,
        stiffness=_stiffness_of_the_whole(extent, speed, stiffness),
    )
    return SuitedMaterial(_filled_in(material, speed, stiffness, density), easing)


def _eased_hit_dent(hit: Hit, extent: Extent) -> float:
    """Depth of the dent that the lightest body may leave [m].

    Rings of bodies narrower than the least footprint are narrow and steep: they are seen at less
    than the full height.
    """
    width = min(hit.footprint / (FOOTPRINT * extent.size), 1.0)
    return _EASED_HIT_DENT * width**_NARROW_POWER * extent.radius


def bearing_density(
    coupled: CoupledModel, geom: GeomId, extent: Extent, material: Material
) -> float:
    """Density with which a target bears what may lie on it and hit it [kg/m^2].

    It is chosen as in `suited_material`. The least speed and stiffness of the material count.
    Bending b resists all waves as a speed q sqrt(b) would, or more, with q the wave number of the
    longest wave. A material that yields is to stay elastic. Over deep fluid the density is not
    known: 0.
    """
    if material.deep:
        return 0.0
    speed = float(np.min(material.speed))
    bending = float(np.min(material.bending))
    stiffness = float(np.min(material.stiffness))
    yield_height = float(np.min(material.yield_height))
    speed_by_bending = _LONGEST_WAVE_NUMBER / extent.size * bending**0.5
    speed = float(np.hypot(speed, speed_by_bending))
    density = _density_under(coupled, geom, extent, speed, stiffness, yield_height)
    return min(density, _MAX_DENSITY)


def _speed_and_stiffness(
    model: mujoco.MjModel, extent: Extent, material: Material
) -> tuple[float, float]:
    """Speed and stiffness of a material: its highest and its least, or suited ones if unset."""
    speed = _speed(model, extent) if "speed" in material.unset else float(np.max(material.speed))
    if "stiffness" not in material.unset:
        return speed, float(np.min(material.stiffness))
    # dents are narrow, but no more than the time step resolves
    narrow = narrow_stiffness(extent.size, speed)
    resolved = (_MAX_PHASE_STEP / model.opt.timestep) ** 2
    return speed, float(min(narrow, resolved, _MAX_STIFFNESS))


def _filled_in(material: Material, speed: float, stiffness: float, density: float) -> Material:
    """A material with its unset coefficients filled in."""
    suited = {
        "speed": speed,
        "damping": damping_for(_DECAY_TIME),
        "stiffness": stiffness,
        "density": float(np.clip(density, _MIN_DENSITY, _MAX_DENSITY)),
    }
    return dataclasses.replace(material, **{name: suited[name] for name in material.unset})


def _density_under(
    coupled: CoupledModel,
    geom: GeomId,
    extent: Extent,
    speed: float,
    stiffness: float,
    limit: float = np.inf,
) -> float:
    """The least density with which a target bears a weight at rest and a hit [kg/m^2].

    Neither dents the target deeper than the limit [m]. It is 0 where there is nothing to bear.
    """
    model = coupled.model
    mass, footprint = heaviest(coupled, geom)
    fall = _fall(model, max(extent.size, _height(coupled, geom)))
    hit = Hit(mass, _resting(coupled, geom), footprint, fall)
    dent = min(_HIT_DENT * extent.radius, limit)
    sink = min(_REST_DENT * extent.radius, limit)
    return _density_for(coupled, geom, extent, hit, speed, stiffness, dent=dent, sink=sink)


class Hit(NamedTuple):
    """The bodies that can hit a target.

    Attributes
    ----------
    mass : float
        Reduced mass of the two bodies [kg].
    weight : float
        Mass that may lie on the target [kg].
    footprint : float
        Radius [m].
    speed : float
        [m/s].
    """

    mass: float
    weight: float
    footprint: float
    speed: float


def _density_for(
    coupled: CoupledModel,
    geom: GeomId,
    extent: Extent,
    hit: Hit,
    speed: float,
    stiffness: float,
    *,
    dent: float,
    sink: float,
) -> float:
    """The least density with which a hit dents a target no deeper than wanted [kg/m^2].

    The hit dents it by `dent` at most, and the body at rest sinks in by `sink` at most [m].
    """
    model = coupled.model
    weight = hit.weight * float(np.linalg.norm(model.opt.gravity))  # [N]
    impulse = BOUNCE * hit.mass * hit.speed  # [N s]
    time_constant = max(float(coupled.solref[geom, 0]), 2 * model.opt.timestep)  # [s]
    duration = max(_PULSE_SHARE * time_constant, model.opt.timestep)
    surface = {
        "radius": max(hit.footprint, FOOTPRINT * extent.size),
        "speed": speed,
        "stiffness": _stiffness_of_the_whole(extent, speed, stiffness),
    }
    bearing = density_under(weight, sink, **surface)
    springy = density_after(impulse, dent, duration=duration, **surface)
    return max(bearing, springy)


def _stiffness_of_the_whole(extent: Extent, speed: float, stiffness: float) -> float:
    """Stiffness of a material on a target of finite size [1/s^2].

    The target resists a load at least as its longest wave does.
    """
    return max(stiffness, (_LONGEST_WAVE_NUMBER * speed / extent.size) ** 2)


def lightest_hit(coupled: CoupledModel, geom: GeomId, extent: Extent) -> Hit | None:
    """Hit of the lightest body that can touch a target and is not joined to it, or None.

    The body falls from a height of the target's size, or from where it is above the target as the
    model begins, up to twice the size: higher up, bodies wait to be dropped. If the target moves,
    geoms fixed to the world count too.
    """
    model = coupled.model
    reduced = _reduced_masses(coupled, geom)
    roots = model.body_rootid[model.geom_bodyid]
    masses = model.body_subtreemass[roots]
    others = np.flatnonzero((reduced > 0) & (roots != roots[geom]))
    if not len(others):
        return None
    lightest = geom_id(int(others[np.argmin(reduced[others])]))
    moves = bool(_moves(model)[lightest])
    return Hit(
        mass=float(reduced[lightest]),
        weight=float(masses[lightest] if moves else masses[geom]),
        footprint=float(coupled.footprint_radii[[geom, lightest]].min()),
        speed=_fall(model, _fall_height(coupled, geom, extent)),
    )


def _fall_height(coupled: CoupledModel, geom: GeomId, extent: Extent) -> float:
    """Height from which a typical body falls on a target [m]."""
    height = max(extent.size, _height(coupled, geom))
    return min(height, _MAX_FALL_HEIGHT * extent.size)


def _density(mass: float, extent: Extent) -> float:
    """Mass of a body over the area of a target [kg/m^2]; a mass of 0 stands for an unknown one."""
    if mass <= 0:
        mass = _DEFAULT_DENSITY * extent.volume
    return mass / extent.area


def _speed(model: mujoco.MjModel, extent: Extent) -> float:
    """Suited wave speed [m/s]."""
    return max(extent.size / _CROSSING_TIME, _fall(model, extent.size))


def _fall(model: mujoco.MjModel, height: float) -> float:
    """Speed of a body that has fallen from a height [m/s]; without gravity, a height a second."""
    return float(max(np.sqrt(2 * np.linalg.norm(model.opt.gravity) * height), height))


def _height(coupled: CoupledModel, geom: GeomId) -> float:
    """Greatest height from which bodies fall on a target as the model begins, or it on them [m].

    It is measured between the bounding spheres of the two geoms.
    """
    model = coupled.model
    data = mujoco.MjData(coupled.model)
    mujoco.mj_kinematics(model, data)
    gravity = float(np.linalg.norm(model.opt.gravity))
    up = -model.opt.gravity / max(gravity, _MIN_DIVISOR)
    heights = (data.geom_xpos - data.geom_xpos[geom]) @ up
    gaps = np.abs(heights) - model.geom_rbound - model.geom_rbound[geom]
    moves = _moves(model)
    falls = np.where(heights > 0, moves, moves[geom]) & coupled.can_collide(geom)
    return float(gaps[falls].max(initial=0.0))


def _resting(coupled: CoupledModel, geom: GeomId) -> float:
    """Mass of the heaviest body that can lie on a target, or on which it can lie [kg]."""
    model = coupled.model
    tree_masses = model.body_subtreemass[model.body_rootid]
    masses = np.where(_moves(model), tree_masses[model.geom_bodyid], 0.0)
    touching = coupled.can_collide(geom)
    if not touching.any():
        return 0.0
    return float(max(masses[touching].max(), masses[geom]))


def _moves(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Geoms that are not fixed to the world."""
    return np.asarray(model.body_weldid[model.geom_bodyid] != 0)


def heaviest(coupled: CoupledModel, geom: GeomId) -> tuple[float, float]:
    """Mass of the heaviest body that can touch a target [kg], and its footprint radius [m].

    If both bodies move, it is their reduced mass. A body has the mass of all that it is joined to.
    Where nothing moves, the mass is 0.
    """
    reduced = _reduced_masses(coupled, geom)
    other = int(reduced.argmax())
    footprint = coupled.footprint_radii[[geom, other]].min()
    return float(reduced.max()), float(footprint)


def _reduced_masses(coupled: CoupledModel, geom: GeomId) -> NDArray[np.float64]:
    """Reduced mass of each geom's body and a target's [kg].

    It is 0 where the two cannot touch, or neither moves.
    """
    model = coupled.model
    masses = model.body_subtreemass[model.body_rootid]
    inverse_by_body = np.where(model.body_weldid != 0, 1 / np.maximum(masses, _MIN_DIVISOR), 0.0)
    inverse = inverse_by_body[model.geom_bodyid]
    total = np.where(coupled.can_collide(geom), inverse + inverse[geom], 0.0)
    return np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)


def typical_hit(model: mujoco.MjModel, name: str) -> dict[str, Any]:
    """Arguments of `Material.suited` for a target in its model: size, hit, radius and amplitude.

    The hit is that of the body of median mass that can touch the target, after a fall from a height
    of the target's size, or from where bodies are above it as the model begins, up to twice the
    size: higher up, bodies wait to be dropped. The dent is a twentieth of the size, or less on a
    thin target. Raises `SceneError` if nothing that moves can touch the target, or it is soft.
    """
    geom = find_target(model, name)
    needs = (
        f'the preset "suited" of {name!r} needs a size [m] and a hit [kg, m/s], as size = 1.0, hit '
        "= [0.5, 4.4]"
    )
    if not is_geom(geom, model):
        raise SceneError(f"{needs}: what may hit a flex or a skin is not known")
    coupled = CoupledModel(model, [geom])
    extent = Extent.of(target_mesh(model, geom))
    reduced = _reduced_masses(coupled, geom)
    touching = np.flatnonzero(reduced)
    if not len(touching):
        raise SceneError(f"{needs}: nothing that moves can touch it in the model")
    by_mass = touching[np.argsort(reduced[touching])]
    median = int(by_mass[len(by_mass) // 2])
    speed = _fall(model, _fall_height(coupled, geom, extent))
    return {
        "size": extent.size,
        "hit": (float(reduced[median]), speed),
        "radius": float(coupled.footprint_radii[[geom, median]].min()),
        "amplitude": min(_TYPICAL_DENT, _MAX_TYPICAL_DENT * extent.radius / extent.size),
    }


def suited_resolution(
    coupled: CoupledModel, geom: GeomId, extent: Extent, material: Material
) -> int:
    """Texels along a chart's side, a multiple of 16 from 32 to 256.

    It is 96, or more where that is needed for four texels in the footprint of the heaviest body
    that can touch the target; but no more than can be stepped in four substeps a physics step, as
    estimated before the atlas is made.
    """
    chart_side = np.sqrt(extent.area / 6)  # of a cube's chart [m]
    _, footprint = heaviest(coupled, geom)
    needed = 0.0  # texels along a chart's side
    if 0 < footprint < np.inf:
        needed = _FOOTPRINT_TEXELS * chart_side / footprint
    n = int(np.clip(_RESOLUTION_STEP * np.ceil(needed / _RESOLUTION_STEP), USUAL, MOST))
    speed = float(np.max(material.speed))
    bending = float(np.max(material.bending))
    viscosity = float(np.max(material.viscosity))
    stiffness = float(np.max(material.stiffness))
    while n > LEAST:
        eigenvalue = (
            2 / (_STABLE_SHARE * (chart_side / n))
        ) ** 2  # largest of the operator [1/m^2]
        wave = speed**2 * eigenvalue + bending * eigenvalue**2 + stiffness
        viscous = viscosity * eigenvalue
        substeps = coupled.model.opt.timestep * (viscous + np.sqrt(viscous**2 + 4 * wave)) / 4
        if substeps <= _MAX_SUBSTEPS:
            break
        n -= _RESOLUTION_STEP
    return n


class SuitedTargets(NamedTuple):
    """Materials without unset coefficients, resolutions, and laws of easing, by target name."""

    materials: dict[str, Material]
    resolutions: dict[str, int]
    easings: dict[str, EasingLaw]


def suited_targets(
    model: mujoco.MjModel,
    materials: Mapping[str, Material],
    resolutions: Mapping[str, int | None],
    *,
    can_ease: bool = False,
) -> SuitedTargets:
    """Choose materials' unset coefficients, and resolutions that are None.

    Raises `MeshError` if a target's mesh cannot ripple.
    """
    suited = dict(materials)
    texels = {name: n for name, n in resolutions.items() if n is not None}
    easings: dict[str, EasingLaw] = {}
    geoms: dict[str, GeomId] = {}
    for name in materials:
        target = find_target(model, name)
        if is_geom(target, model):
            geoms[name] = target
        else:
            suited[name] = _suited_to_soft(model, target, materials[name])
            texels.setdefault(name, _SOFT_RESOLUTION)
    open_names = [name for name in geoms if materials[name].unset or name not in texels]
    if not open_names:
        return SuitedTargets(suited, texels, easings)
    coupled = CoupledModel(model, geoms.values())
    for name in open_names:
        mesh = target_mesh(model, geoms[name])
        extent = Extent.of(mesh)
        choice = suited_material(coupled, geoms[name], extent, materials[name], can_ease=can_ease)
        suited[name] = choice.material
        if choice.easing is not None:
            easings[name] = choice.easing
        elif "density" in materials[name].unset:
            _warn_of_unseen(coupled, name, geoms[name], extent)
        if name not in texels:
            n = suited_resolution(coupled, geoms[name], extent, suited[name])
            texels[name] = min(n, _INTRICATE_RESOLUTION) if _is_intricate(mesh) else n
    return SuitedTargets(suited, texels, easings)


def _suited_to_soft(model: mujoco.MjModel, target: TargetId, material: Material) -> Material:
    """The material of a flex or a skin, filled in by its size and the mass of its bodies.

    The bodies that may hit it are not taken into account.
    """
    if not material.unset:
        return material
    surface = SoftSurface(model, target)
    extent = Extent.of(surface.mesh)
    density = _density(float(model.body_mass[surface.bodies].sum()), extent)
    speed, stiffness = _speed_and_stiffness(model, extent, material)
    return _filled_in(material, speed, stiffness, density)


def _is_intricate(mesh: Mesh) -> bool:
    """Whether charts take long on a mesh, as on a robot's cover.

    It has many triangles, and holes, handles or loose parts.
    """
    euler = len(mesh.V) - len(mesh.F) / 2  # of a closed mesh
    is_sphere = mesh.closed and mesh.component_count == 1 and euler == _SPHERE_EULER
    return len(mesh.F) > _MANY_TRIANGLES and not is_sphere


def _warn_of_unseen(coupled: CoupledModel, name: str, geom: GeomId, extent: Extent) -> None:
    """Warn of a target that is made so heavy that hits of a light body are not visible."""
    reduced = _reduced_masses(coupled, geom)
    heaviest_mass = max(_resting(coupled, geom), float(reduced.max()))
    lightest_mass = float(reduced[reduced > 0].min(initial=np.inf))
    if heaviest_mass > _MAX_MASS_RATIO * lightest_mass:
        warn_caller(
            f"the surface of geom {name!r} is to bear {heaviest_mass:.2g} kg: hits of bodies as "
            f"light as {lightest_mass:.2g} kg will not be seen; "
            f"Material.suited(size={extent.size:.2g}, hit=({lightest_mass:.2g}, m/s)) is suited to "
            "them"
        )
