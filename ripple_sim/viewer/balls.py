"""Balls to throw: a pool of free bodies in the model, parked far away until thrown."""

from __future__ import annotations

import colorsys

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

_NAME = "thrown ball {}"
# Parked this many radii above the origin, and this many apart, so that they do not touch.
_AWAY, _APART = 2000.0, 4.0


def add_balls(spec: mujoco.MjSpec, count: int, radius: float, mass: float) -> None:
    """Add balls to a specification, parked above the scene.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled.
    count : int
    radius : float
        [m].
    mass : float
        Of each [kg].
    """
    poses = []
    for i in range(count):
        place = [0.0, 0.0, (_AWAY + _APART * i) * radius]
        body = spec.worldbody.add_body(name=_NAME.format(i), pos=place)
        body.add_freejoint()
        body.add_geom(
            name=_NAME.format(i),
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0, 0],
            mass=mass,
            rgba=[*colorsys.hsv_to_rgb((0.58 + 0.13 * i) % 1.0, 0.65, 0.9), 1.0],
            # a ball belongs to all collision groups of the scene
            contype=2**31 - 1,
            conaffinity=2**31 - 1,
        )
        poses += [*place, 1.0, 0.0, 0.0, 0.0]
    for key in spec.keys:
        if len(key.qpos):
            key.qpos = np.append(key.qpos, poses)
        if len(key.qvel):
            key.qvel = np.append(key.qvel, np.zeros(6 * count))


class Balls:
    """The balls of a model, parked or thrown. When all are thrown, the oldest is thrown again.

    Parameters
    ----------
    model : mujoco.MjModel
        With balls from `add_balls`, or none.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        bodies = [i for i in range(model.nbody) if model.body(i).name.startswith(_NAME.format(""))]
        joints = model.body_jntadr[bodies]
        self.geoms: list[int] = [int(model.body_geomadr[i]) for i in bodies]
        self._positions, self._velocities = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._home = [model.qpos0[p : p + 7].copy() for p in self._positions]
        self._gravity = np.array(model.opt.gravity)
        self._thrown = 0

    @property
    def parked(self) -> range:
        """Numbers of the balls that are parked."""
        return range(min(self._thrown, len(self.geoms)), len(self.geoms))

    def park(self) -> None:
        """Call all balls back; `hold` puts them there."""
        self._thrown = 0

    def hold(self, data: mujoco.MjData) -> None:
        """Keep parked balls where they are. Call it before each physics step."""
        for i in self.parked:
            self._set(data, i, self._home[i], np.zeros(3))

    def throw(self, data: mujoco.MjData, origin: ArrayLike, through: ArrayLike, seconds: float) -> bool:
        """Throw a ball so that it is at a point after a time, on a parabola.

        Parameters
        ----------
        data : mujoco.MjData
        origin, through : [3]
            Where it starts and where it goes, in the world [m].
        seconds : float
            Time of flight [s].

        Returns
        -------
        bool
            Whether there was a ball to throw.
        """
        if not self.geoms:
            return False
        start, end = np.asarray(origin, dtype=np.float64), np.asarray(through, dtype=np.float64)
        velocity = (end - start) / seconds - self._gravity * seconds / 2
        self._set(data, self._thrown % len(self.geoms), np.array([*start, 1.0, 0.0, 0.0, 0.0]), velocity)
        self._thrown += 1
        return True

    def _set(self, data: mujoco.MjData, i: int, pose: NDArray[np.float64], velocity: NDArray[np.float64]) -> None:
        position, speed = self._positions[i], self._velocities[i]
        data.qpos[position : position + 7] = pose
        data.qvel[speed : speed + 6] = [*velocity, 0.0, 0.0, 0.0]
