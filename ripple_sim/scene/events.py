"""A scene's script: timed events of bodies and surfaces.

Free bodies are dropped (and held in place until then), thrown or placed; surfaces are poked, or get
another material; actuators get another control.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import find_any, target_name
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError

from .material_entry import MaterialChange, given_fields

# An event is due from this time before its own time on, since times have round-off [s].
_ROUND_OFF = 1e-9

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class DropEntry(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """`[[drop]]`: hold a free body in place until a time, then release it."""

    body: str
    """With a free joint."""
    time: float
    """Of the release [s]."""
    position: Vector | None = None
    """In the world [m]; by default where it is."""
    orientation: Quaternion | None = None
    """Quaternion w x y z; by default unchanged."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """In the world [m/s]."""
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    """In the world [rad/s]."""


class ThrowEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[throw]]`: give a free body a velocity at a time, from its place or a given one."""

    body: str
    """With a free joint."""
    time: float
    """[s]"""
    velocity: Vector
    """In the world [m/s]."""
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    """In the world [rad/s]."""
    position: Vector | None = None
    """In the world [m]; by default where it is."""
    orientation: Quaternion | None = None
    """Quaternion w x y z; by default unchanged."""


class PlaceEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[place]]`: move a free body to a place at a time, at rest."""

    body: str
    """With a free joint."""
    time: float
    """[s]"""
    position: Vector
    """In the world [m]."""
    orientation: Quaternion | None = None
    """Quaternion w x y z; by default unchanged."""


def free_joint(
    model: mujoco.MjModel, entry: DropEntry | ThrowEntry | PlaceEntry
) -> tuple[int, int]:
    """Addresses of the body's free joint in qpos and qvel."""
    verb = type(entry).__name__.removesuffix("Entry").lower()
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, entry.body)
    if body < 0:
        names = [model.body(i).name for i in range(1, model.nbody)]
        raise SceneError(
            f"[[{verb}]] names the body {entry.body!r}; the model's bodies are "
            f"{', '.join(names) or 'none'}"
        )
    joint = int(model.body_jntadr[body])
    if joint < 0 or model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_FREE):
        valid = "only free bodies can drop" if verb == "drop" else "name a free body"
        raise SceneError(
            f"[[{verb}]] names the body {entry.body!r}, which has no <freejoint/>; {valid}"
        )
    check_time(verb, entry.body, entry.time)
    if entry.orientation is not None and not np.linalg.norm(entry.orientation) > 0:
        raise SceneError(
            f"[[{verb}]] of body {entry.body!r}: orientation must be w x y z, not 0, got "
            f"{entry.orientation}"
        )
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])


def check_time(verb: str, name: str, time: float) -> None:
    """Refuse negative times, infinity and NaN."""
    if not 0 <= time < float("inf"):
        raise SceneError(f"[[{verb}]] of {name!r}: time must be 0 or greater, got {time!r} s")


class PokeEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[poke]]`: an instantaneous push on the surface; in Python `Ripples.poke`."""

    geom: str
    """One that ripples."""
    time: float
    """[s]"""
    point: Vector
    """In the frame of the geom's body, which is the world's for a fixed target [m]; the nearest
    point of the surface is taken."""
    impulse: float
    """[N s]; positive presses inwards."""
    radius: float = 0.0
    """Of the footprint, along the surface [m]; at least two texels are used."""


class ChangeEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[change]]`: change the material of a geom at a time."""

    geom: str
    """One that ripples."""
    time: float
    """[s]"""
    material: MaterialChange
    """The coefficients that change, see below."""


class ControlEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[control]]`: set an actuator's control at a time."""

    actuator: str
    """Its name."""
    time: float
    """[s]"""
    value: float
    """In the actuator's own unit."""


@dataclasses.dataclass(frozen=True)
class Events:
    """All events of a scene."""

    drop: Sequence[DropEntry] = ()
    throw: Sequence[ThrowEntry] = ()
    place: Sequence[PlaceEntry] = ()
    poke: Sequence[PokeEntry] = ()
    change: Sequence[ChangeEntry] = ()
    control: Sequence[ControlEntry] = ()


class Script:
    """Carries out the events. Call `apply` before each physics step.

    Raises
    ------
    SceneError
        If an event names a missing body or geom, a body without a free joint, or has an invalid
        time, orientation, impulse or radius.
    """

    def __init__(self, model: mujoco.MjModel, events: Events, targets: Sequence[str]) -> None:
        moves: list[DropEntry | ThrowEntry | PlaceEntry] = [
            *events.drop,
            *events.throw,
            *events.place,
        ]
        # events of bodies, with the addresses of their joints in qpos and qvel
        self._moves = []
        for entry in sorted(moves, key=lambda entry: entry.time):
            position, velocity = free_joint(model, entry)
            self._moves.append((entry, position, velocity))
        # poses in which bodies are held until they drop, by name
        self._held_poses: dict[str, NDArray[np.float64]] = {}
        surfaces: list[PokeEntry | ChangeEntry] = [*events.poke, *events.change]
        for surface in surfaces:
            _check_surface(model, surface, targets)
        controls = sorted(events.control, key=lambda entry: entry.time)
        self._actuators = {entry.actuator: _actuator(model, entry) for entry in controls}
        others: list[PokeEntry | ChangeEntry | ControlEntry] = [*controls, *surfaces]
        self._others = sorted(others, key=lambda entry: entry.time)

    def apply(self, data: mujoco.MjData, ripples: Ripples) -> None:
        """Carry out the events that are due."""
        move_count = 0
        for entry, position, velocity in self._moves:
            if isinstance(entry, DropEntry):  # the body is held until the time of its drop
                pose = slice(position, position + 7)
                data.qpos[pose] = self._held_poses.setdefault(entry.body, data.qpos[pose].copy())
                data.qvel[velocity : velocity + 6] = 0
            if entry.time <= data.time + _ROUND_OFF:
                move_count += 1
                _move(data, entry, position, velocity)
        # the events are sorted by time: those that were due are the first
        del self._moves[:move_count]
        while self._others and self._others[0].time <= data.time + _ROUND_OFF:
            event = self._others.pop(0)
            if isinstance(event, ControlEntry):
                data.ctrl[self._actuators[event.actuator]] = event.value
            elif isinstance(event, PokeEntry):
                ripples.poke(event.geom, event.point, event.impulse, event.radius)
            else:
                ripples.change_material(event.geom, **given_fields(event.material))


def _move(
    data: mujoco.MjData, entry: DropEntry | ThrowEntry | PlaceEntry, position: int, velocity: int
) -> None:
    """Give a free body the pose and the velocity of an event.

    `position` and `velocity` are the addresses of its joint in qpos and qvel.
    """
    if entry.position is not None:
        data.qpos[position : position + 3] = entry.position
    quaternion = data.qpos[position + 3 : position + 7]
    if entry.orientation is not None:
        quaternion[:] = np.array(entry.orientation) / np.linalg.norm(entry.orientation)
    data.qvel[velocity : velocity + 6] = 0
    if isinstance(entry, PlaceEntry):
        return
    data.qvel[velocity : velocity + 3] = entry.velocity
    # the angular velocity of a free joint is in the body's own frame
    to_body = np.zeros(4)
    mujoco.mju_negQuat(to_body, quaternion)
    angular_velocity = data.qvel[velocity + 3 : velocity + 6]
    mujoco.mju_rotVecQuat(angular_velocity, np.array(entry.angular_velocity), to_body)


def _check_surface(
    model: mujoco.MjModel, entry: PokeEntry | ChangeEntry, targets: Sequence[str]
) -> None:
    """Refuse an event of a surface that does not ripple, or with invalid numbers."""
    verb = "poke" if isinstance(entry, PokeEntry) else "change"
    check_time(verb, entry.geom, entry.time)
    if target_name(model, find_any(model, entry.geom)) not in targets:
        raise SceneError(
            f"[[{verb}]] names the geom {entry.geom!r}, which does not ripple; the rippling geoms "
            f"are {', '.join(map(repr, targets))}"
        )
    if not isinstance(entry, PokeEntry):
        return
    numbers = [entry.impulse, *entry.point]
    if not (np.isfinite(numbers).all() and 0 <= entry.radius < np.inf):
        raise SceneError(
            f"[[poke]] of {entry.geom!r}: point, impulse and radius must be finite numbers, the "
            f"radius 0 or greater, got point {entry.point} m, impulse {entry.impulse!r} N s, "
            f"radius {entry.radius!r} m"
        )


def _actuator(model: mujoco.MjModel, entry: ControlEntry) -> int:
    """Number of the actuator of an event."""
    check_time("control", entry.actuator, entry.time)
    actuator = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, entry.actuator)
    if actuator < 0:
        names = [model.actuator(i).name for i in range(model.nu)]
        raise SceneError(
            f"[[control]] names the actuator {entry.actuator!r}; the model's actuators are "
            f"{', '.join(names) or 'none'}"
        )
    if not np.isfinite(entry.value):
        raise SceneError(
            f"[[control]] of {entry.actuator!r}: value must be a finite number, got {entry.value!r}"
        )
    return int(actuator)
