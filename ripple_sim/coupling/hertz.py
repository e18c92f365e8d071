"""The pulse of a hit by Hertz's law, in place of MuJoCo's soft contact.

Two elastic bodies press each other with a force that grows as the power 3/2 of their approach
(Hertz 1882; Johnson, Contact Mechanics, 1985, sections 4.2 and 11.4). A ball that hits leaves after
microseconds to milliseconds, where MuJoCo's contact holds it for tens of milliseconds. When a hit
begins, its impulse is foreseen from MuJoCo's own contact law, and given over Hertz's time. What
MuJoCo's contact then gives, the surface has already, and the rest comes as it comes: nothing is
lost.
"""

from __future__ import annotations

import dataclasses
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

from .contacts import Contacts, collider_ids, normal_rows
from .energy import impedance
from .geoms import find_any
from .model import CoupledModel
from .target import Target

PULSES = ("contact", "hertz")

# A body is put down, and does not hit, where its speed is what it gains within this time as it
# falls [s].
_PUT_DOWN = 0.005
# Steps of MuJoCo's contact until it is at rest, at most.
_STEPS = 1000
# Product over squared sum of the principal curvatures of a gap that counts as round: 1/4 for a
# ball, 0.08 where one is ten times the other. Hertz's time is off by 4 % there if both count by
# their mean.
_ROUND = 0.08
# Cosine to the axis of a capsule or a cylinder, up to which its side touches.
_SIDE = 0.02
# Mean of the normals under a footprint, below which it lies over an edge.
_EDGE = 0.9
# A pulse is given in so many parts, or as many as it has substeps.
_PARTS = 32
# Shares beyond this are all.
_WHOLE = 1 - 1e-9


def hertz_moduli(model: mujoco.MjModel, targets: Mapping[str, Target]) -> dict[int, float]:
    """E* [Pa] of the targets whose hits have Hertz's pulse, by geom id.

    Raises `SceneError` for a pulse that is unknown, or a modulus that is missing or not positive.
    """
    moduli = {}
    for name, target in targets.items():
        if target.pulse not in PULSES:
            raise SceneError(
                f"pulse is {shown(target.pulse)} for geom {name!r}; valid are "
                f"{', '.join(map(repr, PULSES))}"
            )
        if target.pulse != "hertz":
            continue
        if not POSITIVE.holds(target.modulus):
            raise SceneError(
                f"modulus is {shown(target.modulus)} Pa for geom {name!r}, whose pulse is 'hertz'; "
                f"valid is "
                f"{POSITIVE.words}: E* of the two materials, 1 / E* = (1 - nu1^2) / E1 + (1 - "
                f"nu2^2) / E2, about 1e11 "
                "for steel on steel, 1e9 for wood, 1e6 for a rubber ball on anything hard"
            )
        moduli[find_any(model, name)] = float(target.modulus or 0.0)
    return moduli


def given_share(age: float) -> float:
    """Share of a Hertz pulse's impulse that is given when a share `age` of its time has passed.

    With x the approach over the greatest one, x' = sqrt(1 - x^(5/2)) in its own time: time is an
    incomplete beta function of x^(5/2), and the impulse is (1 - x') / 2 while they approach.
    """
    if age >= _WHOLE:
        return 1.0
    early = min(age, 1 - age)
    share = (1 - math.sqrt(1 - float(betaincinv(0.4, 0.5, 2 * early)))) / 2
    return share if age < 0.5 else 1 - share


class Pulse(NamedTuple):
    """What a hit gives: impulses [N s] on texels [k], over how long, and how long ago it began [s]."""

    texels: Ints
    impulses: Floats
    duration: float
    age: float


@dataclasses.dataclass(frozen=True, eq=False)
class PulsedLoad(Load):
    """A load with pulses, which change within a step."""

    pulses: tuple[Pulse, ...]

    def parts(self, dt: float, substeps: int) -> Iterator[tuple[int, Load]]:
        """Each part is a substep, or the 32nd of the shortest pulse; then what is held alone."""
        held = Load(self.texels, self.forces)
        substep = dt / substeps
        size = max(1, int(min(each.duration for each in self.pulses) / (_PARTS * substep)))
        last = min(
            substeps,
            math.ceil(max(each.duration - each.age for each in self.pulses) / substep * _WHOLE),
        )
        for first in range(0, last, size):
            count = min(size, last - first)
            loads = [held]
            for each in self.pulses:
                begin, end = (
                    (each.age + at * substep) / each.duration for at in (first, first + count)
                )
                share = given_share(end) - given_share(begin)
                if share:
                    loads.append(Load(each.texels, each.impulses * (share / (count * substep))))
            yield count, Load.together(loads)
        if last < substeps:
            yield substeps - last, held


def foreseen(
    model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints
) -> tuple[float, float, float] | None:
    """How a pair hits at the beginning of a step: effective mass [kg], speed [m/s], and the impulse to come [N s].

    None where nothing pushes, or not against a mass, or a body is put down. The mass is the
    contacts' force over the acceleration that all constraints give the pair: where a body hits at
    several places at once, each has its share. The impulse is what it takes to turn the bodies
    round as MuJoCo's contact does in its steps, but for what pulls.
    """
    rows, of = normal_rows(model, data, contacts)
    force = float(data.efc_force[rows].sum())
    if not force > 0:
        return None
    # what is across the normal cancels in a mean over the edges of a pyramid, whatever their forces
    shares = (np.bincount(of, data.efc_force[rows]) / np.bincount(of))[of] / force
    along = np.zeros((2, data.nefc))
    mujoco.mj_mulJacVec(model, data, along[0], data.qacc_smooth)
    mujoco.mj_mulJacVec(model, data, along[1], data.qacc)
    free, solved = along[:, rows] @ shares
    pull = -free  # together [m/s^2]
    start = speed = -shares @ data.efc_vel[rows]
    if not solved > free or speed <= max(pull, 0.0) * _PUT_DOWN:
        return None
    # MuJoCo's contact: a spring [1/s^2] and a damper [1/s] at a depth [m]
    spring, damper, *_ = shares @ data.efc_KBIP[rows]
    depth = shares @ (data.efc_margin - data.efc_pos)[rows]
    solimp = data.contact.solimp[contacts[0]]
    for _ in range(_STEPS):
        decides = impedance(solimp, max(depth, 0.0))
        push = decides * (damper * speed + spring * decides * depth + pull)
        if push <= max(pull, 0.0):
            break
        speed -= (push - pull) * model.opt.timestep
        depth += speed * model.opt.timestep
    mass = force / (solved - free)
    return mass, start, mass * (start + max(-speed, 0.0))


def surface_bend(model: mujoco.MjModel, geom: int, normal: Floats) -> NDArray[np.float64] | None:
    """How the normal of a round geom turns along its surface, where it is the given one, in its frame: [3, 3] [1/m].

    Of spheres, ellipsoids, capsules, the sides of cylinders, and planes; None for all others.
    """
    size = model.geom_size[geom]
    on_side = abs(normal[2]) < _SIDE
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
    """The same of a target, by least squares over some texels; None over an edge.

    Parameters
    ----------
    atlas : Atlas
    texels : int64 [k]
    normal : float64 [3]
        On the side that is touched.
    """
    points, normals = (each.reshape(-1, 3)[texels] for each in (atlas.positions, atlas.normals))
    mean = normals.mean(axis=0)
    if np.linalg.norm(mean) < _EDGE:
        return None
    away = points - points.mean(axis=0)
    turned = normals - mean
    bend = turned.T @ away @ np.linalg.pinv(away.T @ away, rcond=1e-6) * np.sign(mean @ normal)
    return (bend + bend.T) / 2


class Hits:
    """Gives the hits on a target the pulse of Hertz's law.

    It is that of two smooth round bodies: the other geom is a sphere, an ellipsoid, a capsule, the
    side of a cylinder or a plane, and the gap is about as round along one axis as along the other.
    Other hits keep MuJoCo's pulse, and a warning says so, once a reason. Bodies that are put down
    keep it without a word, and all that comes after a hit.

    Parameters
    ----------
    coupled : CoupledModel
    target : int
        Geom id.
    modulus : float
        E* [Pa].
    """

    def __init__(self, coupled: CoupledModel, target: int, modulus: float) -> None:
        self._coupled = coupled
        self._target = target
        self._modulus = modulus
        self._pulses: list[Pulse] = []
        self._told: set[str] = set()

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
            Of that geom.
        texels : int64 [k]
            That carry them.
        shares : float64 [k]
            What a unit of the contacts' impulse gives these.

        Returns
        -------
        float
            Impulse that the target gets by the pulse [N s], positive inwards.
        """
        other = int(pair.others[0])
        colliders = collider_ids(self._coupled, data)
        ours = np.isin(colliders, [self._target, *self._coupled.collision_geoms(self._target)])
        touching = (ours[:, ::-1] & (colliders == other)).any(axis=1) & (
            data.contact.efc_address >= 0
        )
        hit = foreseen(self._coupled.model, data, touching.nonzero()[0])
        if hit is None or not shares.any():
            return 0.0
        radius = self._radius(data, atlas, pair, texels, other)
        if isinstance(radius, str):
            if radius not in self._told:
                self._told.add(radius)
                names = self._coupled.names
                owners = self._coupled.owners
                own = names[owners[self._target]]
                others = names[owners[other]]
                warn_caller(
                    f"the hit of {others!r} on {own!r} keeps MuJoCo's contact pulse, and so do "
                    f"others like it: {radius}"
                )
            return 0.0
        # how long two elastic bodies touch: Johnson, equation 11.24, whose factor is 2.87, with
        # 1 / m = 1 / m1 + 1 / m2 and 1 / R = 1 / R1 + 1 / R2
        mass, speed, impulse = hit
        duration = 2.868 * (mass**2 / (radius * self._modulus**2 * speed)) ** 0.2
        impulses = impulse * shares
        self._pulses.append(Pulse(texels, impulses, duration, 0.0))
        return float(impulses.sum())

    def over(self, load: Load, elapsed: float) -> Load:
        """A load with the pulses of a time [s], which then has passed."""
        if not self._pulses:
            return load
        pulses = tuple(self._pulses)
        older = (each._replace(age=each.age + elapsed) for each in pulses)
        self._pulses = [each for each in older if each.age < _WHOLE * each.duration]
        return PulsedLoad(load.texels, load.forces, pulses)

    def _radius(
        self, data: mujoco.MjData, atlas: Atlas, pair: Contacts, texels: Ints, other: int
    ) -> float | str:
        """Radius of the ball on a plane whose gap is like that of a pair [m], or why there is none."""
        coupled = self._coupled
        if self._target in coupled.soft or other >= coupled.model.ngeom:
            return "Hertz's law is one of rigid geoms, not of flexes and skins"
        shares = pair.forces / pair.forces.sum()
        normal = shares @ pair.normals
        normal /= np.linalg.norm(normal)
        turn = data.geom_xmat[other].reshape(3, 3)
        own = data.geom_xmat[self._target].reshape(3, 3)
        theirs = surface_bend(coupled.model, other, -normal @ turn)
        if theirs is None:
            return "valid are spheres, ellipsoids, capsules, sides of cylinders, and planes"
        ours = atlas_bend(atlas, texels, normal @ own)
        if ours is None:
            return "an edge is hit"
        across = np.eye(3) - np.outer(normal, normal)
        gap = across @ (turn @ theirs @ turn.T + own @ ours @ own.T) @ across
        total = float(np.trace(gap))
        product = (total**2 - float((gap * gap).sum())) / 2
        if total <= 0 or product < _ROUND * total**2:
            return "they touch along a line, or over an area, not at a point"
        return product**-0.5
