"""The pulse of a hit by Hertz's law instead of MuJoCo's soft contact.

Two elastic bodies press each other with a force that grows as the power 3/2 of their approach
(Hertz 1882; Johnson, Contact Mechanics, 1985, sections 4.2 and 11.4). A ball that hits leaves after
microseconds to milliseconds, where MuJoCo's contact holds it for tens of milliseconds. When a hit
begins, its impulse is foreseen from MuJoCo's own contact law, and given over Hertz's time. The
surface then has the impulse of MuJoCo's contact in advance. If the contact gives more than the
foreseen impulse, the rest follows when it comes, so that nothing is lost.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas, Load
from ripple_sim.solver.errors import POSITIVE, shown, warn_caller
from ripple_sim.solver.kernel import Floats, Ints
from ripple_sim.solver.waves.load import StepLoad

from .contacts import Contacts, collider_ids, normal_rows
from .energy import impedance
from .geoms import find_any
from .ids import ColliderId, GeomId, TargetId, is_geom
from .model import CoupledModel
from .target import Target

PULSES = ("contact", "hertz")

# A body that gains its speed within this time as it falls is put down, and does not hit [s].
_PUT_DOWN_TIME = 0.005
# Largest number of steps of MuJoCo's contact within which the bodies part.
_MAX_CONTACT_STEPS = 1000
# Product over squared sum of the principal curvatures of a gap that counts as round: 1/4 for a
# ball, 0.08 where one is ten times the other. Hertz's time is off by 4 % there if both count by
# their mean.
_MIN_ROUNDNESS = 0.08
# Cosine between a normal and the axis of a capsule or a cylinder, up to which its side touches.
_MAX_SIDE_COSINE = 0.02
# Length of the mean of the normals under a footprint below which the footprint lies over an edge.
_MIN_MEAN_NORMAL = 0.9
# A pulse is divided into so many parts, or into as many as it has substeps.
_PARTS_PER_PULSE = 32
# From this share of its time on a pulse is over; the rest is round-off.
_OVER = 1 - 1e-9
# Singular values of a footprint's extent below this share of the greatest are 0: the footprint has
# no extent along its normal.
_MIN_EXTENT_SHARE = 1e-6
# Factor of Hertz's time of contact: Johnson, equation 11.24, whose rounded factor is 2.87.
_HERTZ_TIME_FACTOR = 2.868


def hertz_moduli(model: mujoco.MjModel, targets: Mapping[str, Target]) -> dict[TargetId, float]:
    """E* [Pa] of the targets whose hits have Hertz's pulse.

    Raises `SceneError` for a pulse that is unknown, or a modulus that is missing or not positive.
    """
    moduli: dict[TargetId, float] = {}
    for name, target in targets.items():
        if target.pulse not in PULSES:
            raise SceneError(
                f"pulse of geom {name!r} must be one of {', '.join(map(repr, PULSES))}, got "
                f"{shown(target.pulse)}"
            )
        if target.pulse != "hertz":
            continue
        if not POSITIVE.holds(target.modulus):
            raise SceneError(
                f"modulus of geom {name!r}, whose pulse is 'hertz', must be {POSITIVE.words}, "
                f"got {shown(target.modulus)} Pa: E* of the two materials, 1 / E* = (1 - nu1^2) "
                "/ E1 + (1 - nu2^2) / E2, about 1e11 for steel on steel, 1e9 for wood, 1e6 for "
                "a rubber ball on anything hard"
            )
        moduli[find_any(model, name)] = float(target.modulus or 0.0)
    return moduli


def given_share(age: float) -> float:
    """Share of a Hertz pulse's impulse that is given when a share `age` of its time has passed.

    Let x be the approach over its greatest value. The speed of approach, over the speed of the hit,
    is sqrt(1 - x^(5/2)). So the time is an incomplete beta function of x^(5/2) with the parameters
    2/5 and 1/2. While the bodies approach, the share of the impulse is (1 - speed) / 2; they part
    as they have approached.
    """
    if age >= _OVER:
        return 1.0
    age_while_approaching = min(age, 1 - age)
    x_to_five_halves = float(betaincinv(0.4, 0.5, 2 * age_while_approaching))
    speed = math.sqrt(1 - x_to_five_halves)
    share = (1 - speed) / 2
    return share if age < 0.5 else 1 - share


class Pulse(NamedTuple):
    """The impulse of a hit, which is given over some time.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices.
    impulses : float64 [k]
        On the texels [N s], positive inwards.
    duration : float
        How long the pulse lasts [s].
    age : float
        How long ago the pulse began [s].
    """

    texels: Ints
    impulses: Floats
    duration: float
    age: float

    def load(self, first: int, count: int, substep: float) -> Load | None:
        """Mean force over `count` substeps [s] from the first one; None where nothing is given."""
        begin = (self.age + first * substep) / self.duration
        end = (self.age + (first + count) * substep) / self.duration
        share = given_share(end) - given_share(begin)
        if not share:
            return None
        return Load(self.texels, self.impulses * (share / (count * substep)))


class PulsedLoad(NamedTuple):
    """A constant load together with pulses, which change within a step; a `StepLoad`.

    It is no `Load`: what takes constant forces alone does not take it.

    Attributes
    ----------
    constant : Load
    pulses : tuple of Pulse
        At least one.
    """

    constant: Load
    pulses: tuple[Pulse, ...]

    def parts(self, dt: float, substeps: int) -> Iterator[tuple[int, Load]]:
        """Load by load, with the number of substeps for which each acts.

        A part is a substep, or a 32nd of the shortest pulse if that is longer. At last comes the
        constant load alone.
        """
        substep = dt / substeps
        shortest = min(pulse.duration for pulse in self.pulses)
        remaining = max(pulse.duration - pulse.age for pulse in self.pulses)
        substeps_a_part = max(1, int(shortest / (_PARTS_PER_PULSE * substep)))
        pulsed_substeps = min(substeps, math.ceil(remaining / substep * _OVER))
        for first in range(0, pulsed_substeps, substeps_a_part):
            count = min(substeps_a_part, pulsed_substeps - first)
            loads = [self.constant]
            for pulse in self.pulses:
                load = pulse.load(first, count, substep)
                if load is not None:
                    loads.append(load)
            yield count, Load.together(loads)
        if pulsed_substeps < substeps:
            yield substeps - pulsed_substeps, self.constant


class Hit(NamedTuple):
    """How a pair hits at the beginning of a step.

    Attributes
    ----------
    mass : float
        Effective mass [kg].
    speed : float
        With which the two approach [m/s].
    impulse : float
        Impulse that MuJoCo's contact is going to give [N s].
    """

    mass: float
    speed: float
    impulse: float


def foreseen(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> Hit | None:
    """The hit of a pair whose contacts begin in this step, by their indices among MuJoCo's, [k].

    None if nothing pushes, if there is no mass to push, or if a body is put down. The mass is the
    contacts' force over the acceleration that all constraints give the pair: where a body hits at
    several places at once, each place has its share. The impulse turns the bodies round as MuJoCo's
    contact does in its steps, without the forces that pull the two together.
    """
    rows, contact_of_row = normal_rows(model, data, contacts)
    row_forces = data.efc_force[rows]
    force = float(row_forces.sum())
    if not force > 0:
        return None
    # in a mean over the edges of a pyramid the motion across the normal cancels, whatever their
    # forces
    edge_means = np.bincount(contact_of_row, row_forces) / np.bincount(contact_of_row)
    shares = edge_means[contact_of_row] / force
    accelerations = np.zeros((2, data.nefc))
    mujoco.mj_mulJacVec(model, data, accelerations[0], data.qacc_smooth)
    mujoco.mj_mulJacVec(model, data, accelerations[1], data.qacc)
    # along the normal, without and with the constraints' forces [m/s^2]
    free, solved = accelerations[:, rows] @ shares
    pull = -free  # acceleration towards each other [m/s^2]
    speed = -shares @ data.efc_vel[rows]
    if not solved > free or speed <= max(pull, 0.0) * _PUT_DOWN_TIME:
        return None
    rebound = _rebound_speed(model, data, contacts, rows, shares, speed, pull)
    mass = force / (solved - free)
    return Hit(mass, speed, mass * (speed + rebound))


def _rebound_speed(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    contacts: Ints,
    rows: Ints,
    shares: Floats,
    speed: float,
    pull: float,
) -> float:
    """Speed with which MuJoCo's contact lets two bodies part [m/s]; 0 where they stay together.

    Parameters
    ----------
    model, data, contacts
        See `foreseen`.
    rows : int64 [m]
        Of the constraint solver, which carry the normal forces of the contacts.
    shares : float64 [m]
        Of each row in the motion of the pair.
    speed : float
        With which the two approach [m/s].
    pull : float
        Acceleration towards each other without the contact [m/s^2].
    """
    # MuJoCo's contact: a spring [1/s^2] and a damper [1/s] at a depth [m]
    spring, damper, *_ = shares @ data.efc_KBIP[rows]
    depth = shares @ (data.efc_margin - data.efc_pos)[rows]
    solimp = data.contact.solimp[contacts[0]]
    for _ in range(_MAX_CONTACT_STEPS):
        impedance_here = impedance(solimp, max(depth, 0.0))
        push = impedance_here * (damper * speed + spring * impedance_here * depth + pull)
        if push <= max(pull, 0.0):
            break
        speed -= (push - pull) * model.opt.timestep
        depth += speed * model.opt.timestep
    return max(-speed, 0.0)


def surface_bend(model: mujoco.MjModel, geom: GeomId, normal: Floats) -> NDArray[np.float64] | None:
    """How the normal of a round geom turns along its surface, in the geom's frame, [3, 3] [1/m].

    It holds where the surface has the given normal [3]. Round are spheres, ellipsoids, capsules,
    the sides of cylinders, and planes; None for all others.
    """
    size = model.geom_size[geom]
    on_side = abs(normal[2]) < _MAX_SIDE_COSINE
    match mujoco.mjtGeom(model.geom_type[geom]):
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return np.diag(size**-2.0) * np.linalg.norm(size * normal)
        case mujoco.mjtGeom.mjGEOM_CAPSULE | mujoco.mjtGeom.mjGEOM_CYLINDER if on_side:
            return np.diag([1.0, 1.0, 0.0]) / size[0]
        case mujoco.mjtGeom.mjGEOM_SPHERE | mujoco.mjtGeom.mjGEOM_CAPSULE:
            return np.eye(3) / size[0]
        case mujoco.mjtGeom.mjGEOM_PLANE:
            return np.zeros((3, 3))
    return None


def atlas_bend(atlas: Atlas, texels: Ints, normal: Floats) -> NDArray[np.float64] | None:
    """How the normal of a target turns along its surface, [3, 3] [1/m]; None over an edge.

    It is found by least squares over some texels.

    Parameters
    ----------
    atlas : Atlas
    texels : int64 [k]
    normal : float64 [3]
        On the side that is touched.
    """
    points = atlas.positions.reshape(-1, 3)[texels]
    normals = atlas.normals.reshape(-1, 3)[texels]
    mean_normal = normals.mean(axis=0)
    if np.linalg.norm(mean_normal) < _MIN_MEAN_NORMAL:
        return None
    offsets = points - points.mean(axis=0)
    turns = normals - mean_normal
    inverse = np.linalg.pinv(offsets.T @ offsets, rcond=_MIN_EXTENT_SHARE)
    bend = turns.T @ offsets @ inverse * np.sign(mean_normal @ normal)
    return (bend + bend.T) / 2


class Hits:
    """Gives the hits on a target the pulse of Hertz's law.

    The law is one of two smooth round bodies: the other geom is a sphere, an ellipsoid, a capsule,
    the side of a cylinder or a plane, and the gap is about as round along one axis as along the
    other. Other hits keep MuJoCo's pulse, and a warning says so, once for each reason. MuJoCo's
    pulse also stays for bodies that are put down, and for all forces after a hit; both without a
    warning.

    Parameters
    ----------
    coupled : CoupledModel
    target : TargetId
    modulus : float
        E* [Pa].
    """

    def __init__(self, coupled: CoupledModel, target: TargetId, modulus: float) -> None:
        self._coupled = coupled
        self._target = target
        self._modulus = modulus
        self._pulses: list[Pulse] = []
        # reasons for which a warning was given
        self._warned_of: set[str] = set()

    def clear(self) -> None:
        """End all pulses."""
        self._pulses = []

    def begin(
        self, data: mujoco.MjData, atlas: Atlas, pair: Contacts, texels: Ints, shares: Floats
    ) -> float:
        """Begin the pulse of a geom that touches for the first time, if that is a hit.

        Parameters
        ----------
        data : mujoco.MjData
        atlas : Atlas
        pair : Contacts
            Of the geom with the target.
        texels : int64 [k]
            The texels that carry the contacts.
        shares : float64 [k]
            What a unit of the contacts' impulse gives each texel.

        Returns
        -------
        float
            Impulse that the target gets by the pulse [N s], positive inwards.
        """
        other = ColliderId(int(pair.others[0]))
        hit = foreseen(self._coupled.model, data, self._contacts_with(data, other))
        if hit is None or not shares.any():
            return 0.0
        radius = self._radius(data, atlas, pair, texels, other)
        if isinstance(radius, str):
            self._warn(other, radius)
            return 0.0
        # how long two elastic bodies touch, with 1 / m = 1 / m1 + 1 / m2 and
        # 1 / R = 1 / R1 + 1 / R2
        time_to_the_fifth = hit.mass**2 / (radius * self._modulus**2 * hit.speed)
        duration = _HERTZ_TIME_FACTOR * time_to_the_fifth**0.2
        impulses = hit.impulse * shares
        self._pulses.append(Pulse(texels, impulses, duration, age=0.0))
        return float(impulses.sum())

    def over(self, load: Load, elapsed: float) -> StepLoad:
        """Add the pulses of the coming time [s] to a load, and let them age by it."""
        if not self._pulses:
            return load
        pulses = tuple(self._pulses)
        older = (pulse._replace(age=pulse.age + elapsed) for pulse in pulses)
        self._pulses = [pulse for pulse in older if pulse.age < _OVER * pulse.duration]
        return PulsedLoad(load, pulses)

    def _contacts_with(self, data: mujoco.MjData, other: ColliderId) -> Ints:
        """MuJoCo's contacts of a collider with the target that carry a force, [k]."""
        colliders = collider_ids(self._coupled, data)
        solids: list[ColliderId] = [self._target]
        if is_geom(self._target, self._coupled.model):
            solids += self._coupled.collision_geoms(self._target)
        is_solid = np.isin(colliders, solids)
        is_of_pair = (is_solid[:, ::-1] & (colliders == other)).any(axis=1)
        return (is_of_pair & (data.contact.efc_address >= 0)).nonzero()[0]

    def _warn(self, other: ColliderId, reason: str) -> None:
        """Warn once that hits keep MuJoCo's pulse for this reason."""
        if reason in self._warned_of:
            return
        self._warned_of.add(reason)
        names = self._coupled.names
        owners = self._coupled.owners
        target_name = names[owners[self._target]]
        other_name = names[owners[other]]
        warn_caller(
            f"the hit of {other_name!r} on {target_name!r} keeps MuJoCo's contact pulse, and so do "
            f"others like it: {reason}"
        )

    def _radius(
        self, data: mujoco.MjData, atlas: Atlas, pair: Contacts, texels: Ints, other: ColliderId
    ) -> float | str:
        """Radius of a ball on a plane with the same gap as the pair [m], or why there is none."""
        coupled = self._coupled
        if not (is_geom(self._target, coupled.model) and is_geom(other, coupled.model)):
            return "Hertz's law is one of rigid geoms, not of flexes and skins"
        shares = pair.forces / pair.forces.sum()
        normal = shares @ pair.normals
        normal /= np.linalg.norm(normal)
        rotation = data.geom_xmat[other].reshape(3, 3)
        target_rotation = data.geom_xmat[self._target].reshape(3, 3)
        bend = surface_bend(coupled.model, other, -normal @ rotation)
        if bend is None:
            return (
                "Hertz's law here is for spheres, ellipsoids, capsules, sides of cylinders, and "
                "planes"
            )
        target_bend = atlas_bend(atlas, texels, normal @ target_rotation)
        if target_bend is None:
            return "an edge is hit"
        across = np.eye(3) - np.outer(normal, normal)
        bend_in_world = rotation @ bend @ rotation.T
        target_bend_in_world = target_rotation @ target_bend @ target_rotation.T
        gap = across @ (bend_in_world + target_bend_in_world) @ across
        # sum and product of the principal curvatures of the gap
        total = float(np.trace(gap))
        product = (total**2 - float((gap * gap).sum())) / 2
        if total <= 0 or product < _MIN_ROUNDNESS * total**2:
            return "they touch along a line, or over an area, not at a point"
        return product**-0.5
