"""Timed drops: a body is held where the MJCF puts it until its time comes, then let go."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from .errors import SceneError

Vector = tuple[float, float, float]


class DropEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[drop]]`: let a free body go at a time [s], from a position [m] (default: where it is) at a velocity [m/s]."""

    body: str
    time: float
    position: Vector | None = None
    velocity: Vector = (0.0, 0.0, 0.0)


class Drops:
    """Holds bodies and lets them go. Call `apply` before each physics step.

    Raises
    ------
    SceneError
        If a body does not exist or has no free joint, or a time is invalid.
    """

    def __init__(self, model: mujoco.MjModel, entries: Sequence[DropEntry]) -> None:
        self._waiting = [(entry, *free_joint(model, entry)) for entry in sorted(entries, key=lambda e: e.time)]
        self._home: dict[str, NDArray[np.float64]] = {}

    def apply(self, data: mujoco.MjData) -> None:
        """Put waiting bodies back to their places, and let go those whose time has come."""
        released = 0
        for entry, position, velocity in self._waiting:
            pose = slice(position, position + 7)
            home = self._home.setdefault(entry.body, data.qpos[pose].copy())
            data.qpos[pose] = home
            data.qvel[velocity : velocity + 6] = 0
            if entry.time <= data.time + 1e-9:
                if entry.position is not None:
                    data.qpos[position : position + 3] = entry.position
                data.qvel[velocity : velocity + 3] = entry.velocity
                released += 1
        # sorted by time: those let go are the first
        del self._waiting[:released]


def free_joint(model: mujoco.MjModel, entry: DropEntry) -> tuple[int, int]:
    """Addresses of the body's free joint in qpos and qvel."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, entry.body)
    if body < 0:
        names = [model.body(i).name for i in range(1, model.nbody)]
        raise SceneError(f"[[drop]] names the body {entry.body!r}; the model's bodies are {', '.join(names) or 'none'}")
    joint = int(model.body_jntadr[body])
    if joint < 0 or model.jnt_type[joint] != int(mujoco.mjtJoint.mjJNT_FREE):
        raise SceneError(
            f"[[drop]] names the body {entry.body!r}, which has no <freejoint/>; only free bodies can drop"
        )
    if not 0 <= entry.time < float("inf"):
        raise SceneError(f"[[drop]] of body {entry.body!r} has time {entry.time!r} s; valid is 0 or greater")
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
