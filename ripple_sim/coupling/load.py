"""From the contacts of a physics step to the loads on the texels of all targets.

What the contacts did is kept, from which the user's records of impulses are made when they are
asked for. Bodies that MuJoCo lets sleep have no contacts in its data; they still press on what they
lie on.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, Load, WaveSolver
from ripple_sim.solver.kernel import Bools, Floats, Ints

from .contacts import ContactReader, Contacts, first_rows
from .easing import Easing
from .hertz import Hits
from .model import CoupledModel
from .patches import Footprints, corners, load_points
from .rest_filter import DEFAULT_TIME_CONSTANT, NO_FORCES, RestFilter, TexelForces
from .sleep import SLEEP, at_rest
from .soft import target_pose

_TINY = 1e-12

# A body falls asleep after it was slow for this many steps: `mjMINAWAKE` of MuJoCo.
_SLOW_STEPS = 10


class SleepingContacts:
    """Holds the contacts of bodies that sleep on a target that sleeps too or is static.

    A sleeping body's contacts stay where they were, with their mean force over the steps before it
    fell asleep, until one of the two wakes.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._coupled = coupled
        # by target and other: the latest contacts, and their summed forces in the latest steps [N]
        self._pairs: dict[tuple[int, int], tuple[Contacts, collections.deque[float]]] = {}

    def add(self, data: mujoco.MjData, contacts: Mapping[int, Contacts]) -> dict[int, Contacts]:
        """Contacts of each target, by geom id, with those of sleeping bodies."""
        present = {
            (t, other): pair
            for t, each in contacts.items()
            for other, pair in each.split(each.others).items()
        }
        found = dict(contacts)
        for key, (pair, sums) in list(self._pairs.items()):
            if key in present:
                continue
            if self._coupled.are_still(data, key):
                mean = pair._replace(
                    forces=pair.forces * (sum(sums) / len(sums) / pair.forces.sum())
                )
                found[key[0]] = (
                    Contacts.together([found[key[0]], mean]) if key[0] in found else mean
                )
            else:
                sums.append(0.0)
                if not any(sums):
                    del self._pairs[key]
        for key, pair in present.items():
            _, sums = self._pairs.get(key, (pair, collections.deque[float](maxlen=_SLOW_STEPS)))
            sums.append(float(pair.forces.sum()))
            self._pairs[key] = pair, sums
        return found


@dataclasses.dataclass(frozen=True, eq=False)
class Impulse:
    """The impulse that one geom gave to one target in one physics step; one at each place where it is wedged.

    Two are equal if all their values are.

    Attributes
    ----------
    geom, other : str
        Names of the target and of the geom or flex that touches it.
    point : float64 [3]
        Force-weighted contact point on the target's true surface, in the world [m].
    impulse : float
        Sum of normal force times time step [N s]; it pushes inwards, or is negative where something
        sticks and pulls. Through a flex collider, of the whole force along the surface's normal.
    texel : tuple of int
        Chart, row and column of the texel nearest to the point.
    inner : bool
        Whether the inner side of an open surface was touched: then it pushes outwards.
    """

    geom: str
    other: str
    point: NDArray[np.float64]
    impulse: float
    texel: tuple[int, int, int]
    inner: bool = False

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Impulse):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def _values(self) -> tuple[object, ...]:
        """All fields, with the point as a tuple, since NumPy compares arrays entry by entry."""
        return (
            self.geom,
            self.other,
            tuple(self.point.tolist()),
            self.impulse,
            self.texel,
            self.inner,
        )


class StepContacts(NamedTuple):
    """What touched a target in a step, and what its surface got, before the rest filter.

    Attributes
    ----------
    target : int
    position : float64 [3]
        Of the target in the world [m].
    rotation : float64 [3, 3]
        From its frame to the world.
    contacts : Contacts
    starts : int64 [p]
        The first contact of each collider that touches.
    places : float64 [p, 3]
        Surface points nearest to the force-weighted middles of their contacts, in the target's
        frame [m].
    texels : int64 [p]
        Flat indices of the texels nearest to these.
    forces : float64 [p]
        Their normal forces [N].
    inner : bool [p]
        Whether the inner side of an open surface is touched.
    on_texels : TexelForces
    """

    target: int
    position: Floats
    rotation: Floats
    contacts: Contacts
    starts: Ints
    places: Floats
    texels: Ints
    forces: Floats
    inner: Bools
    on_texels: TexelForces

    def impulses(
        self, names: Sequence[str], owners: Ints, atlas: Atlas, timestep: float
    ) -> Iterator[Impulse]:
        """One record for each geom or flex that touches; for each place of one that touches in several.

        Parameters
        ----------
        names, owners
            See `CoupledModel`.
        atlas : Atlas
            Of the target.
        timestep : float
            How long the forces were held [s].
        """
        geom = names[owners[self.target]]
        others = owners[self.on_texels.geoms]
        places = self.places
        forces = self.forces
        texels = self.texels
        inner = self.inner
        # the last ids are those of a flex's vertices, which touch for themselves and are told of
        # together
        if others[-1] != self.on_texels.geoms[-1]:
            first = first_rows(others)
            weighted = np.add.reduceat(forces[:, None] * places, first)
            forces = np.add.reduceat(forces, first)
            others = others[first]
            inner = inner[first]
            places, texels = atlas.nearest(weighted / forces[:, None])
        # what touches in several places, and not in their middle, as what is wedged does
        elif (
            apart := ((places - self.on_texels.middles) ** 2).sum(axis=1)
            > self.on_texels.place_radii**2
        ).any():
            ends = np.append(self.starts[1:], len(self.contacts.forces))
            points = (self.contacts.points - self.position) @ self.rotation
            rows = np.repeat(np.arange(len(self.starts)), ends - self.starts)
            whose, middles, forces = corners(
                rows, points, self.contacts.forces, 2 * self.on_texels.place_radii
            )
            kept = np.concatenate([(~apart).nonzero()[0], apart[whose].nonzero()[0] + len(apart)])
            whose = np.concatenate([np.arange(len(apart)), whose])[kept]
            forces = np.concatenate([self.forces, forces])[kept]
            places, texels = atlas.nearest(np.concatenate([places, middles])[kept])
            others = others[whose]
            inner = inner[whose]
        points = self.position + places @ self.rotation.T
        at = zip(
            *(each.tolist() for each in np.unravel_index(texels, atlas.areas.shape)), strict=True
        )
        told = zip(
            others.tolist(), points, (forces * timestep).tolist(), at, inner.tolist(), strict=True
        )
        for other, point, impulse, texel, behind in told:
            yield Impulse(geom, names[other], point, impulse, texel, behind)


class TargetLoad:
    """The load of all geoms on one target, step by step.

    Parameters
    ----------
    waves : WaveSolver
        Of the target.
    target : int
        Geom id.
    radii : float64 [c]
        Footprint radius of each collider [m]: of a pair the smaller one counts.
    convex : bool [c]
        Whether what touches at two points touches between them too.
    time_constant : float
        Of contacts with it [s].
    hits : Hits, optional
        What gives hits the pulse of Hertz's law.
    easing : Easing, optional
        What share of forces is taken up; by default all.
    """

    def __init__(
        self,
        waves: WaveSolver,
        target: int,
        radii: NDArray[np.float64],
        convex: NDArray[np.bool_],
        time_constant: float = DEFAULT_TIME_CONSTANT,
        hits: Hits | None = None,
        easing: Easing | None = None,
    ) -> None:
        self._hits = hits
        self._easing = easing
        self._target = target
        self._radii = np.minimum(radii, radii[target])
        self._convex = convex
        self._is_open = not waves.atlas.mesh.closed
        self._filter = RestFilter(len(radii), waves.atlas.areas.size, time_constant)
        self.set_waves(waves)

    def set_waves(self, waves: WaveSolver) -> None:
        """Go on with new waves on the same atlas; impulses that are yet to be given stay."""
        self._waves = waves
        self._atlas = waves.atlas
        self._footprints = Footprints(waves.atlas, waves.operator.movable.reshape(-1))
        self._filter.forget_places()

    def take_up_all(self) -> None:
        """Ease no forces any more."""
        self._easing = None

    def touched(
        self,
        contacts: Contacts,
        pose: tuple[Floats, Floats],
        timestep: float,
        elapsed: float,
        data: mujoco.MjData | None = None,
    ) -> tuple[Load, StepContacts]:
        """Load over a time in which geoms touch, and what they did.

        Parameters
        ----------
        contacts : Contacts
        pose : (float64 [3], float64 [3, 3])
            Position of the target in the world [m], and rotation from its frame to the world.
        timestep, elapsed : float
            How long the contacts' forces were held, and over which time their impulse is given [s].
        data : mujoco.MjData, optional
            Whose contacts they are, for hits.
        """
        if self._waves.atlas is not self._atlas:  # the surface has moved
            self._atlas = self._waves.atlas
            self._footprints.follow(self._atlas)
        starts = first_rows(contacts.others)
        (position, rotation) = pose
        geoms = contacts.others[starts]
        points = (contacts.points - position) @ rotation
        forces = np.add.reduceat(contacts.forces, starts)
        middles = np.add.reduceat(contacts.forces[:, None] * points, starts) / forces[:, None]
        places, at = self._atlas.nearest_places(middles)
        inner = np.zeros(len(starts), dtype=np.bool_)
        if self._is_open:  # which may be touched from inside
            pushes = (
                np.add.reduceat(np.abs(contacts.forces)[:, None] * contacts.normals, starts)
                @ rotation
            )
            inner = np.asarray((pushes * self._atlas.texels.grid.normals[at]).sum(axis=1) < 0)
        patches, points, parts, radii = load_points(
            points,
            contacts.forces,
            starts,
            self._radii[geoms],
            self._convex[geoms],
            self._atlas.closest_places,
        )
        under = self._footprints.under(geoms[patches], points, radii, self._filter.active)
        # what touches from inside pushes outwards
        signs = np.where(inner, -timestep / elapsed, timestep / elapsed)
        if self._easing is not None:
            signs *= self._easing.shares(geoms, at, forces * (timestep / elapsed), elapsed)
        pushes = parts * signs[patches]
        texels, shares = (np.concatenate(each) for each in zip(*under, strict=True))
        counts = [len(each) for each, _ in under]
        first = np.searchsorted(patches, np.arange(len(geoms) + 1))
        begins = np.array([0, *itertools.accumulate(counts)])[first]
        on_texels = TexelForces(
            geoms,
            middles,
            radii[first[:-1]] / 2,
            begins,
            texels,
            shares * np.repeat(pushes, counts),
        )
        done = StepContacts(
            self._target, *pose, contacts, starts, places, at, forces, inner, on_texels
        )
        self._filter.set_timestep(timestep)
        if self._hits is not None and data is not None:
            for row in self._filter.arrived(geoms, elapsed):
                mine = slice(begins[row], begins[row + 1])
                # what a unit of the contact's impulse gives each texel
                shares = on_texels.forces[mine] * (elapsed / (timestep * forces[row]))
                pair = contacts.rows(contacts.others == geoms[row])
                prepaid = self._hits.begin(data, self._atlas, pair, texels[mine], shares)
                self._filter.prepay(int(geoms[row]), prepaid)
        return self.given(elapsed, on_texels), done

    def given(self, elapsed: float, present: TexelForces = NO_FORCES) -> Load:
        """Load over a time [s] in which these forces act, or in which no geom touches, with the pulses of hits."""
        if self._easing is not None and present is NO_FORCES:
            self._easing.pause(elapsed)
        load = self._filter(present, elapsed)
        return load if self._hits is None else self._hits.over(load, elapsed)


class ContactLoads:
    """The loads of all contacts, target by target and step by step.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Geom id of every target to its waves. Looked at again by `waves_changed` and `clear`.
    hits : mapping, optional
        Geom id of targets whose hits have the pulse of Hertz's law.
    easings : mapping, optional
        Geom id of targets that take up a share of forces alone.

    Attributes
    ----------
    since_skip : list of StepContacts
        What touched the targets since `skip`, step by step.
    """

    def __init__(
        self,
        coupled: CoupledModel,
        waves: Mapping[int, WaveSolver],
        hits: Mapping[int, Hits] | None = None,
        easings: Mapping[int, Easing] | None = None,
    ) -> None:
        self._coupled = coupled
        self._waves = waves
        self._hits = hits or {}
        self._easings = dict(easings or {})
        self._contacts = ContactReader(coupled, {geom: each.atlas for geom, each in waves.items()})
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._sleeping: SleepingContacts | None = None
        coupled = self._coupled
        self._targets = dict[int, TargetLoad]()
        for geom, waves in self._waves.items():
            surface = coupled.soft.get(geom)
            hits = self._hits.get(geom)
            constant = DEFAULT_TIME_CONSTANT
            if surface is None:
                constant = float(coupled.solref[geom, 0])
            elif surface.flex >= 0:
                constant = float(coupled.model.flex_solref[surface.flex, 0])
            if constant <= 0:  # -omega^2 of a spring: 1 / omega stands for a time constant
                constant = 1 / float(np.sqrt(max(-constant, _TINY)))
            # a flex has a contact at each of its vertices: nothing touches between them
            convex = coupled.convex & (surface is None)
            easing = self._easings.get(geom)
            self._targets[geom] = TargetLoad(
                waves, geom, coupled.footprint_radii, convex, constant, hits, easing
            )
            if hits is not None:
                hits.clear()
            if easing is not None:
                easing.clear()
        self.skip()

    def skip(self) -> None:
        """Forget the latest steps: nothing was given since."""
        self.since_skip: list[StepContacts] = []
        self._impulses: list[Impulse] | None = None

    def waves_changed(self, geom: int) -> None:
        """Go on with the new waves of a target."""
        self._targets[geom].set_waves(self._waves[geom])

    def take_up_all(self, geom: int) -> None:
        """Ease no forces on a target any more."""
        self._easings.pop(geom, None)
        self._targets[geom].take_up_all()

    def loads(self, data: mujoco.MjData, elapsed: float) -> dict[int, Load]:
        """Load on each target over a time [s], from the contact forces that MuJoCo held over its latest time step.

        Bodies that sleep press as before.
        """
        loads = {}
        self._impulses = None
        self._timestep = self._coupled.model.opt.timestep
        contacts = self._contacts.read(data)
        if self._coupled.model.opt.enableflags & SLEEP:
            if self._sleeping is None:
                # bodies that sleep already never touched before our eyes
                self._sleeping = SleepingContacts(self._coupled)
                resting = at_rest(self._coupled.model, data)
                if resting is not None:
                    self._sleeping.add(data, self._contacts.read(resting))
            contacts = self._sleeping.add(data, contacts)
        for geom, target in self._targets.items():
            if geom in contacts:
                pose = target_pose(data, geom)
                loads[geom], done = target.touched(
                    contacts[geom], pose, self._timestep, elapsed, data
                )
                self.since_skip.append(done)
            else:
                loads[geom] = target.given(elapsed)
        return loads

    @property
    def impulses(self) -> list[Impulse]:
        """The impulses given since `skip`, one record for each pair and step, or for each place of what is wedged."""
        if self._impulses is None:
            names = self._coupled.names
            owners = self._coupled.owners
            self._impulses = [
                impulse
                for done in self.since_skip
                for impulse in done.impulses(
                    names, owners, self._waves[done.target].atlas, self._timestep
                )
            ]
        return self._impulses
