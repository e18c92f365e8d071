"""Timed motion of free bodies: dropped (held until then), thrown, or placed."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class DropEntry(msgspec.Struct, forbid_unknown_fields=True):
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


class Motions:
    """Sets bodies in motion at their times. Call `apply` before each physics step.

    Raises
    ------
    SceneError
        If a body does not exist or has no free joint, or a time or an orientation is invalid.
    """

    def __init__(self, model: mujoco.MjModel, entries: Sequence[DropEntry | ThrowEntry | PlaceEntry]) -> None:
        self._waiting = [(entry, *free_joint(model, entry)) for entry in sorted(entries, key=lambda e: e.time)]
        self._home: dict[str, NDArray[np.float64]] = {}

    def apply(self, data: mujoco.MjData) -> None:
        """Hold bodies that wait for their drop, and set the bodies in motion whose time has come."""
        begun = 0
        for entry, position, velocity in self._waiting:
            if isinstance(entry, DropEntry):
                pose = slice(position, position + 7)
                data.qpos[pose] = self._home.setdefault(entry.body, data.qpos[pose].copy())
                data.qvel[velocity : velocity + 6] = 0
            if entry.time <= data.time + 1e-9:
                _set_motion(data, entry, position, velocity)
                begun += 1
        # sorted by time: those that have begun are the first
        del self._waiting[:begun]


def _set_motion(data: mujoco.MjData, entry: DropEntry | ThrowEntry | PlaceEntry, position: int, velocity: int) -> None:
    if entry.position is not None:
        data.qpos[position : position + 3] = entry.position
    quaternion = data.qpos[position + 3 : position + 7]
    if entry.orientation is not None:
        quaternion[:] = np.array(entry.orientation) / np.linalg.norm(entry.orientation)
    data.qvel[velocity : velocity + 6] = 0
    if not isinstance(entry, PlaceEntry):
        data.qvel[velocity : velocity + 3] = entry.velocity
        # a free joint keeps its angular velocity in the body's own frame
        back = np.zeros(4)
        mujoco.mju_negQuat(back, quaternion)
        mujoco.mju_rotVecQuat(data.qvel[velocity + 3 : velocity + 6], np.array(entry.angular_velocity), back)


def free_joint(model: mujoco.MjModel, entry: DropEntry | ThrowEntry | PlaceEntry) -> tuple[int, int]:
    """Addresses of the body's free joint in qpos and qvel."""
    verb = type(entry).__name__.removesuffix("Entry").lower()
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, entry.body)
    if body < 0:
        names = [model.body(i).name for i in range(1, model.nbody)]
        raise SceneError(
            f"[[{verb}]] names the body {entry.body!r}; the model's bodies are {', '.join(names) or 'none'}"
        )
    joint = int(model.body_jntadr[body])
    if joint < 0 or model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_FREE):
        raise SceneError(
            f"[[{verb}]] names the body {entry.body!r}, which has no <freejoint/>; only free bodies can {verb}"
            if verb == "drop"
            else f"[[{verb}]] names the body {entry.body!r}, which has no <freejoint/>; valid are free bodies"
        )
    check_time(verb, entry.body, entry.time)
    if entry.orientation is not None and not np.linalg.norm(entry.orientation) > 0:
        raise SceneError(
            f"[[{verb}]] of body {entry.body!r} has orientation {entry.orientation}; valid is w x y z, not 0"
        )
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])


def check_time(verb: str, name: str, time: float) -> None:
    """Refuse negative times, infinity and NaN."""
    if not 0 <= time < float("inf"):
        raise SceneError(f"[[{verb}]] of {name!r} has time {time!r} s; valid is 0 or greater")
