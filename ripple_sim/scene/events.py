"""A scene's script: timed events of bodies and surfaces."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import msgspec
import mujoco
import numpy as np

from ripple_sim.coupling.geoms import find_any, target_name
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError

from .material_entry import MaterialChange, given_fields
from .motion import DropEntry, Motions, PlaceEntry, ThrowEntry, Vector, check_time


class PokeEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[poke]]`: an instantaneous push on the surface; in Python `Ripples.poke`."""

    geom: str
    """One that ripples."""
    time: float
    """[s]"""
    point: Vector
    """In the frame of the geom's body, which is the world's for a fixed target [m]; the nearest point of the surface is
    taken."""
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
        If an event names a missing body or geom, or has an invalid time, impulse or radius.
    """

    def __init__(self, model: mujoco.MjModel, events: Events, targets: Sequence[str]) -> None:
        self._motions = Motions(model, [*events.drop, *events.throw, *events.place])
        for poke in events.poke:
            _check_target(model, "poke", poke, targets)
            if not (np.isfinite([poke.impulse, *poke.point]).all() and 0 <= poke.radius < np.inf):
                raise SceneError(
                    f"[[poke]] of {poke.geom!r} has point {poke.point} m, impulse {poke.impulse!r} N s, radius "
                    f"{poke.radius!r} m; valid are finite numbers, the radius 0 or greater"
                )
        for change in events.change:
            _check_target(model, "change", change, targets)
        self._controls = [(entry, _actuator(model, entry)) for entry in sorted(events.control, key=lambda e: e.time)]
        surface_events: list[PokeEntry | ChangeEntry] = [*events.poke, *events.change]
        self._surface_events = sorted(surface_events, key=lambda event: event.time)

    def apply(self, data: mujoco.MjData, ripples: Ripples) -> None:
        """Carry out the events that are due."""
        self._motions.apply(data)
        while self._controls and self._controls[0][0].time <= data.time + 1e-9:
            entry, actuator = self._controls.pop(0)
            data.ctrl[actuator] = entry.value
        while self._surface_events and self._surface_events[0].time <= data.time + 1e-9:
            event = self._surface_events.pop(0)
            if isinstance(event, PokeEntry):
                ripples.poke(event.geom, event.point, event.impulse, event.radius)
            else:
                ripples.change_material(event.geom, **given_fields(event.material))


def _check_target(model: mujoco.MjModel, verb: str, entry: PokeEntry | ChangeEntry, targets: Sequence[str]) -> None:
    check_time(verb, entry.geom, entry.time)
    if target_name(model, find_any(model, entry.geom)) not in targets:
        raise SceneError(
            f"[[{verb}]] names the geom {entry.geom!r}, which does not ripple; the rippling geoms are "
            f"{', '.join(map(repr, targets))}"
        )


def _actuator(model: mujoco.MjModel, entry: ControlEntry) -> int:
    check_time("control", entry.actuator, entry.time)
    actuator = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, entry.actuator)
    if actuator < 0:
        names = [model.actuator(i).name for i in range(model.nu)]
        raise SceneError(
            f"[[control]] names the actuator {entry.actuator!r}; the model's actuators are {', '.join(names) or 'none'}"
        )
    if not np.isfinite(entry.value):
        raise SceneError(f"[[control]] of {entry.actuator!r} has value {entry.value!r}; valid is a finite number")
    return int(actuator)
