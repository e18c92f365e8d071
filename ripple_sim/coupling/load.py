"""From the contacts of a physics step to the loads on the texels of all targets.

The contacts of each step are kept. The user's records of impulses are made from them on request.
Bodies that MuJoCo lets sleep have no contacts in its data; they still press on the targets that
they lie on.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, WaveSolver
from ripple_sim.solver.kernel import Bools, Floats, Ints
from ripple_sim.solver.waves.load import StepLoad

from .contact_state import DEFAULT_TIME_CONSTANT
from .contacts import ContactReader, Contacts, first_rows
from .easing import Easing
from .energy import Key
from .hertz import Hits
from .ids import TargetId, is_geom
from .model import CoupledModel
from .patches import Footprints, corners, load_points
from .rest_filter import NO_FORCES, RestFilter, TexelForces
from .sleep import SLEEP, at_rest
from .soft import target_pose

# Keeps a division by the stiffness of a contact's spring finite [1/s^2].
_MIN_STIFFNESS = 1e-12

# A body falls asleep after it was slow for this many steps: `mjMINAWAKE` of MuJoCo.
_SLOW_STEPS = 10


class SleepingContacts:
    """Holds the contacts of bodies that sleep on a target that sleeps too or is static.

    The contacts of a sleeping body stay where they were, with their mean force over the steps
    before the body fell asleep, until body or target wakes.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._coupled = coupled
        # by target and other: the latest contacts, and their summed forces in the latest steps [N]
        self._pairs: dict[Key, tuple[Contacts, collections.deque[float]]] = {}

    def add(
        self, data: mujoco.MjData, contacts: Mapping[TargetId, Contacts]
    ) -> dict[TargetId, Contacts]:
        """Contacts of each target, with those of sleeping bodies."""
        present: dict[Key, Contacts] = {}
        for target, on_target in contacts.items():
            for other, pair in on_target.by_other().items():
                present[target, other] = pair
        all_contacts = dict(contacts)
        for key, (pair, sums) in list(self._pairs.items()):
            if key in present:
                continue
            if not self._coupled.are_still(data, key):
                sums.append(0.0)
                if not any(sums):
                    del self._pairs[key]
                continue
            mean_force = sum(sums) / len(sums)
            asleep = pair._replace(forces=pair.forces * (mean_force / pair.forces.sum()))
            target = key[0]
            if target in all_contacts:
                asleep = Contacts.together([all_contacts[target], asleep])
            all_contacts[target] = asleep
        for key, pair in present.items():
            _, sums = self._pairs.get(key, (pair, collections.deque[float](maxlen=_SLOW_STEPS)))
            sums.append(float(pair.forces.sum()))
            self._pairs[key] = pair, sums
        return all_contacts


@dataclasses.dataclass(frozen=True, eq=False)
class Impulse:
    """The impulse that one geom gave to one target in one physics step.

    A geom that is wedged gives one at each place where it touches. Two impulses are equal if all
    their values are.

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


class _Touches(NamedTuple):
    """Where geoms or flexes touch a target, for the records of impulses.

    Attributes
    ----------
    others : int64 [m]
        Owners of the colliders that touch, see `CoupledModel`.
    places : float64 [m, 3]
        Points on the surface, in the target's frame [m].
    texels : int64 [m]
        Flat indices of the texels nearest to the places.
    forces : float64 [m]
        [N].
    inner : bool [m]
        Whether the inner side of an open surface is touched.
    """

    others: Ints
    places: Floats
    texels: Ints
    forces: Floats
    inner: Bools


class StepContacts(NamedTuple):
    """The contacts of a target in a step and the impulses of its surface, before the rest filter.

    Attributes
    ----------
    target : TargetId
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
        Flat indices of the texels nearest to the places.
    forces : float64 [p]
        Normal force of each collider [N].
    inner : bool [p]
        Whether the inner side of an open surface is touched.
    on_texels : TexelForces
        The forces on the texels, which the rest filter takes.
    """

    target: TargetId
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
        """One record for each geom or flex that touches, and for each place where it is wedged.

        Parameters
        ----------
        names, owners
            See `CoupledModel`.
        atlas : Atlas
            Of the target.
        timestep : float
            How long the forces were held [s].
        """
        others = owners[self.on_texels.geoms]
        offsets2 = ((self.places - self.on_texels.middles) ** 2).sum(axis=1)
        wedged = offsets2 > self.on_texels.place_radii**2
        # the last ids are the ids of a flex's vertices, which touch one by one
        if others[-1] != self.on_texels.geoms[-1]:
            touches = self._joined_by_flex(others, atlas)
        elif wedged.any():
            touches = self._divided_where(wedged, others, atlas)
        else:
            touches = _Touches(others, self.places, self.texels, self.forces, self.inner)
        points = self.position + touches.places @ self.rotation.T
        impulses = (touches.forces * timestep).tolist()
        charts, rows, columns = np.unravel_index(touches.texels, atlas.areas.shape)
        texels = zip(charts.tolist(), rows.tolist(), columns.tolist(), strict=True)
        inner = touches.inner.tolist()
        records = zip(touches.others.tolist(), points, impulses, texels, inner, strict=True)
        geom = names[owners[self.target]]
        for other, point, impulse, texel, is_inner in records:
            yield Impulse(geom, names[other], point, impulse, texel, is_inner)

    def _joined_by_flex(self, others: Ints, atlas: Atlas) -> _Touches:
        """Touches with the vertices of each flex joined, at their force-weighted middle."""
        first = first_rows(others)
        weighted = np.add.reduceat(self.forces[:, None] * self.places, first)
        forces = np.add.reduceat(self.forces, first)
        places, texels = atlas.nearest(weighted / forces[:, None])
        return _Touches(others[first], places, texels, forces, self.inner[first])

    def _divided_where(self, wedged: Bools, others: Ints, atlas: Atlas) -> _Touches:
        """Touches with the geoms that are wedged, [p], divided into the places where they touch.

        A geom that is wedged touches in several places, and not in their middle.
        """
        count = len(wedged)
        ends = np.append(self.starts[1:], len(self.contacts.forces))
        points = (self.contacts.points - self.position) @ self.rotation
        rows = np.repeat(np.arange(count), ends - self.starts)
        corner_rows, corner_points, corner_forces = corners(
            rows, points, self.contacts.forces, 2 * self.on_texels.place_radii
        )
        # geoms that are not wedged, then the corners of geoms that are
        undivided = (~wedged).nonzero()[0]
        divided = wedged[corner_rows].nonzero()[0]
        chosen = np.concatenate([undivided, divided + count])
        rows = np.concatenate([np.arange(count), corner_rows])[chosen]
        forces = np.concatenate([self.forces, corner_forces])[chosen]
        places, texels = atlas.nearest(np.concatenate([self.places, corner_points])[chosen])
        return _Touches(others[rows], places, texels, forces, self.inner[rows])


class TargetLoad:
    """The load of all geoms on one target, step by step.

    Parameters
    ----------
    waves : WaveSolver
        Of the target.
    target : TargetId
    radii : float64 [c]
        Footprint radius of each collider [m]: of a pair the smaller one counts.
    convex : bool [c]
        Whether a collider that touches at two points touches between them too.
    time_constant : float
        Of contacts with the target [s].
    hits : Hits, optional
        Gives hits the pulse of Hertz's law.
    easing : Easing, optional
        Says which share of forces is taken up; by default all.
    """

    def __init__(
        self,
        waves: WaveSolver,
        target: TargetId,
        radii: NDArray[np.float64],
        convex: NDArray[np.bool_],
        time_constant: float = DEFAULT_TIME_CONSTANT,
        hits: Hits | None = None,
        easing: Easing | None = None,
    ) -> None:
        self._target = target
        self._radii = np.minimum(radii, radii[target])
        self._convex = convex
        self._hits = hits
        self._easing = easing
        self._is_open = not waves.atlas.mesh.closed
        self._filter = RestFilter(len(radii), waves.atlas.areas.size, time_constant)
        self.set_waves(waves)

    def set_waves(self, waves: WaveSolver) -> None:
        """Continue with new waves on the same atlas; impulses that are yet to be given stay."""
        self._waves = waves
        self._atlas = waves.atlas
        self._footprints = Footprints(waves.atlas, waves.operator.movable.reshape(-1))
        self._filter.forget_places()

    def take_up_all(self) -> None:
        """Take up every force completely from now on."""
        self._easing = None

    def touched(
        self,
        contacts: Contacts,
        pose: tuple[Floats, Floats],
        timestep: float,
        elapsed: float,
        data: mujoco.MjData | None = None,
    ) -> tuple[StepLoad, StepContacts]:
        """Load over a time in which geoms touch, and a record of the touches.

        Parameters
        ----------
        contacts : Contacts
        pose : (float64 [3], float64 [3, 3])
            Position of the target in the world [m], and rotation from its frame to the world.
        timestep, elapsed : float
            How long the contacts' forces were held, and over which time their impulse is given [s].
        data : mujoco.MjData, optional
            The data that holds the contacts; without it no hit begins.
        """
        if self._waves.atlas is not self._atlas:  # the surface has moved
            self._atlas = self._waves.atlas
            self._footprints.follow(self._atlas)
        (position, rotation) = pose
        starts = first_rows(contacts.others)
        geoms = contacts.others[starts]
        points = (contacts.points - position) @ rotation
        forces = np.add.reduceat(contacts.forces, starts)
        middles = np.add.reduceat(contacts.forces[:, None] * points, starts) / forces[:, None]
        places, texels = self._atlas.nearest_places(middles)
        inner = self._touch_inside(contacts, starts, rotation, texels)
        # force on the surface over force of the contacts: negative from inside, which is outwards
        factors = np.where(inner, -timestep / elapsed, timestep / elapsed)
        if self._easing is not None:
            held_forces = forces * (timestep / elapsed)
            factors *= self._easing.shares(geoms, texels, held_forces, elapsed)
        on_texels = self._spread(points, contacts.forces, starts, geoms, middles, factors)
        touches = StepContacts(
            target=self._target,
            position=position,
            rotation=rotation,
            contacts=contacts,
            starts=starts,
            places=places,
            texels=texels,
            forces=forces,
            inner=inner,
            on_texels=on_texels,
        )
        if data is not None:
            self._begin_hits(touches, timestep, elapsed, data)
        return self.over(elapsed, on_texels), touches

    def over(self, elapsed: float, present: TexelForces = NO_FORCES) -> StepLoad:
        """Load of these forces over a time [s], with the pulses of hits."""
        if self._easing is not None and present is NO_FORCES:
            self._easing.pause(elapsed)
        load = self._filter(present, elapsed)
        return load if self._hits is None else self._hits.over(load, elapsed)

    def _touch_inside(
        self, contacts: Contacts, starts: Ints, rotation: Floats, texels: Ints
    ) -> Bools:
        """Whether each collider touches the inner side of an open surface, [p].

        Parameters
        ----------
        contacts, starts, rotation, texels
            See `StepContacts`.
        """
        if not self._is_open:
            return np.zeros(len(starts), dtype=np.bool_)
        amounts = np.abs(contacts.forces)[:, None]
        outward = np.add.reduceat(amounts * contacts.normals, starts) @ rotation
        return np.asarray((outward * self._atlas.texels.grid.normals[texels]).sum(axis=1) < 0)

    def _spread(
        self,
        points: Floats,
        forces: Floats,
        starts: Ints,
        geoms: Ints,
        middles: Floats,
        factors: Floats,
    ) -> TexelForces:
        """Spread the forces of contacts over the texels.

        Parameters
        ----------
        points : float64 [k, 3]
            Of the contacts, in the target's frame [m].
        forces : float64 [k]
            Of the contacts [N].
        starts, geoms : int64 [p]
            The first contact of each collider, and the collider's id.
        middles : float64 [p, 3]
            Force-weighted contact points [m].
        factors : float64 [p]
            Force on the surface over force of the contacts.
        """
        patches, points, point_forces, radii = load_points(
            points,
            forces,
            starts,
            self._radii[geoms],
            self._convex[geoms],
            self._atlas.closest_places,
        )
        under = self._footprints.under(geoms[patches], points, radii, self._filter.active)
        texels = np.concatenate([point_texels for point_texels, _ in under])
        shares = np.concatenate([point_shares for _, point_shares in under])
        counts = [len(point_texels) for point_texels, _ in under]
        point_begins = np.append(0, np.cumsum(counts))
        first_points = np.searchsorted(patches, np.arange(len(geoms) + 1))
        pushes = point_forces * factors[patches]
        return TexelForces(
            geoms=geoms,
            middles=middles,
            place_radii=radii[first_points[:-1]] / 2,
            begins=point_begins[first_points],
            texels=texels,
            forces=shares * np.repeat(pushes, counts),
        )

    def _begin_hits(
        self, touches: StepContacts, timestep: float, elapsed: float, data: mujoco.MjData
    ) -> None:
        """Begin the pulses of the geoms that touch for the first time."""
        if self._hits is None:
            return
        contacts = touches.contacts
        geoms, _, _, begins, texels, texel_forces = touches.on_texels
        for row in self._filter.arrived(geoms):
            rows = slice(begins[row], begins[row + 1])
            # impulse that each texel gets for a unit of the contact's impulse
            shares = texel_forces[rows] * (elapsed / (timestep * touches.forces[row]))
            pair = contacts.rows(contacts.others == geoms[row])
            prepaid = self._hits.begin(data, self._atlas, pair, texels[rows], shares)
            self._filter.prepay(int(geoms[row]), prepaid, elapsed)


class ContactLoads:
    """The loads of all contacts, target by target and step by step.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Every target to its waves. `waves_changed` and `clear` look at the mapping again.
    hits : mapping, optional
        Pulses by target, for targets whose hits have the pulse of Hertz's law.
    easings : mapping, optional
        Easing by target, for targets that take up only a share of forces.

    Attributes
    ----------
    since_skip : list of StepContacts
        What touched the targets since `skip`, step by step.
    """

    def __init__(
        self,
        coupled: CoupledModel,
        waves: Mapping[TargetId, WaveSolver],
        hits: Mapping[TargetId, Hits] | None = None,
        easings: Mapping[TargetId, Easing] | None = None,
    ) -> None:
        self._coupled = coupled
        self._waves = waves
        self._hits = hits or {}
        self._easings = dict(easings or {})
        atlases = {geom: solver.atlas for geom, solver in waves.items()}
        self._contacts = ContactReader(coupled, atlases)
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._sleeping: SleepingContacts | None = None
        self._targets = {geom: self._target_load(geom) for geom in self._waves}
        for hits in self._hits.values():
            hits.clear()
        for easing in self._easings.values():
            easing.clear()
        self.skip()

    def _target_load(self, target: TargetId) -> TargetLoad:
        coupled = self._coupled
        # a flex has a contact at each of its vertices: nothing touches between them
        convex = coupled.convex & is_geom(target, coupled.model)
        return TargetLoad(
            self._waves[target],
            target,
            coupled.footprint_radii,
            convex,
            self._time_constant(target),
            self._hits.get(target),
            self._easings.get(target),
        )

    def _time_constant(self, target: TargetId) -> float:
        """Time constant of contacts with a target, from its `solref` [s]."""
        surface = self._coupled.soft.get(target)
        constant = DEFAULT_TIME_CONSTANT
        if surface is None:
            constant = float(self._coupled.solref[target, 0])
        elif surface.flex >= 0:
            constant = float(self._coupled.model.flex_solref[surface.flex, 0])
        if constant <= 0:  # -omega^2 of a spring: 1 / omega stands for a time constant
            constant = 1 / float(np.sqrt(max(-constant, _MIN_STIFFNESS)))
        return constant

    def skip(self) -> None:
        """Forget the touches of the latest steps."""
        self.since_skip: list[StepContacts] = []
        self._impulses: list[Impulse] | None = None

    def waves_changed(self, target: TargetId) -> None:
        """Continue with the new waves of a target."""
        self._targets[target].set_waves(self._waves[target])

    def take_up_all(self, target: TargetId) -> None:
        """Take up every force on a target completely from now on."""
        self._easings.pop(target, None)
        self._targets[target].take_up_all()

    def loads(self, data: mujoco.MjData, elapsed: float) -> dict[TargetId, StepLoad]:
        """Load on each target over a time [s], from the contact forces of MuJoCo's latest step.

        Bodies that sleep press as before.
        """
        loads: dict[TargetId, StepLoad] = {}
        self._impulses = None
        self._timestep = self._coupled.model.opt.timestep
        contacts = self._contacts.read(data)
        if self._coupled.model.opt.enableflags & SLEEP:
            contacts = self._with_sleeping(data, contacts)
        for target, target_load in self._targets.items():
            if target not in contacts:
                loads[target] = target_load.over(elapsed)
                continue
            pose = target_pose(data, target)
            loads[target], touches = target_load.touched(
                contacts[target], pose, self._timestep, elapsed, data
            )
            self.since_skip.append(touches)
        return loads

    def _with_sleeping(
        self, data: mujoco.MjData, contacts: dict[TargetId, Contacts]
    ) -> dict[TargetId, Contacts]:
        """Contacts of each target, with those of sleeping bodies."""
        if self._sleeping is None:
            # the contacts of bodies that sleep from the beginning were never seen
            self._sleeping = SleepingContacts(self._coupled)
            resting = at_rest(self._coupled.model, data)
            if resting is not None:
                self._sleeping.add(data, self._contacts.read(resting))
        return self._sleeping.add(data, contacts)

    @property
    def impulses(self) -> list[Impulse]:
        """The impulses given since `skip`; see `StepContacts.impulses`."""
        if self._impulses is None:
            names = self._coupled.names
            owners = self._coupled.owners
            impulses: list[Impulse] = []
            for touches in self.since_skip:
                atlas = self._waves[touches.target].atlas
                impulses += touches.impulses(names, owners, atlas, self._timestep)
            self._impulses = impulses
        return self._impulses
