"""Opening a scene or a mesh in the viewer, with balls to throw at it.

The balls are free bodies in the model, parked far away until they are thrown.
"""

from __future__ import annotations

import colorsys
import ctypes
import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.geoms import find_target
from ripple_sim.coupling.ids import is_geom
from ripple_sim.coupling.soft import SoftSurface
from ripple_sim.coupling.suited import suited_targets
from ripple_sim.scene.drop import drop_scene, is_scene
from ripple_sim.scene.loading import load_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.scene.source import scene_path
from ripple_sim.solver import Material

_BALL_NAME = "thrown ball {}"

# Height of parked balls above the origin, in radii: outside every view.
_PARKING_HEIGHT = 2000.0

# Distance between parked balls, in radii: they do not touch.
_PARKING_SPACING = 4.0

# balls that a scene has to throw
BALLS = 6

# over the size of the surface
_BALL_RADIUS = 0.06
_POKE_RADIUS = 0.06
_POKE_DEPTH = 0.025

# [s]: time of flight of a thrown ball
FLIGHT = 0.5

# Distance that a thrown ball covers, over the size of the surface.
_THROW_DISTANCE = 3.0

# Coefficients of the material that determine how fast a dent swings back.
SWINGING = ("speed", "stiffness", "density")


def add_balls(spec: mujoco.MjSpec, count: int, radius: float, mass: float) -> None:
    """Add balls of a radius [m] and a mass [kg] each to a specification, parked above the scene."""
    poses = []
    for i in range(count):
        place = [0.0, 0.0, (_PARKING_HEIGHT + _PARKING_SPACING * i) * radius]
        body = spec.worldbody.add_body(name=_BALL_NAME.format(i), pos=place)
        body.add_freejoint()
        body.add_geom(
            name=_BALL_NAME.format(i),
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
    """The balls that `add_balls` gave a model, parked or thrown.

    When all are thrown, the oldest is thrown again.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        bodies = [
            i for i in range(model.nbody) if model.body(i).name.startswith(_BALL_NAME.format(""))
        ]
        joints = model.body_jntadr[bodies]
        self.geoms: list[int] = [int(model.body_geomadr[i]) for i in bodies]
        self._positions = model.jnt_qposadr[joints]
        self._velocities = model.jnt_dofadr[joints]
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

    def throw(
        self, data: mujoco.MjData, origin: ArrayLike, through: ArrayLike, seconds: float
    ) -> bool:
        """Throw a ball from one point of the world, so that it reaches another after a time [s].

        It flies on a parabola.

        Returns whether there was a ball to throw.
        """
        if not self.geoms:
            return False
        start = np.asarray(origin, dtype=np.float64)
        end = np.asarray(through, dtype=np.float64)
        velocity = (end - start) / seconds - self._gravity * seconds / 2
        self._set(
            data, self._thrown % len(self.geoms), np.array([*start, 1.0, 0.0, 0.0, 0.0]), velocity
        )
        self._thrown += 1
        return True

    def _set(
        self, data: mujoco.MjData, i: int, pose: NDArray[np.float64], velocity: NDArray[np.float64]
    ) -> None:
        position = self._positions[i]
        speed = self._velocities[i]
        data.qpos[position : position + 7] = pose
        data.qvel[speed : speed + 6] = [*velocity, 0.0, 0.0, 0.0]


def poke_strength(material: Material, size: float) -> tuple[float, float]:
    """Radius [m] and impulse [N s] of a poke, for a surface of a size [m].

    The poke presses the surface in by a few per cent of the size.

    The footprint (1 - (d / r)^2)^3 has its peak at 4 / (pi r^2), so an impulse J sets its middle
    moving at 4 J / (pi r^2 sigma); it swings back at about omega^2 = (2 c / r)^2 + k.
    """
    radius = _POKE_RADIUS * size
    speed, stiffness, density = (float(np.max(getattr(material, name))) for name in SWINGING)
    omega = np.hypot(2 * speed / radius, np.sqrt(stiffness))
    # nothing pulls a surface without stiffness back: it then gets a second
    return radius, _POKE_DEPTH * size * density * np.pi * radius**2 / 4 * max(float(omega), 1.0)


class Opened(NamedTuple):
    """A scene with balls to throw, and what it was made from.

    Attributes
    ----------
    scene : Scene
    file : Path or None
        Its scene file; None for a mesh.
    spec : mujoco.MjSpec
        Of its model without the balls.
    """

    scene: Scene
    file: Path | None
    spec: mujoco.MjSpec


def open_scene(target: str | Path, **options: Any) -> Scene:
    """Scene by name, TOML file or mesh file, with balls to throw; arguments as for `opened`."""
    return opened(target, **options).scene


def opened(
    target: str | Path,
    *,
    bodies: int = 3,
    seed: int = 0,
    up: str | None = None,
    repair: bool = False,
    wrap: bool = False,
) -> Opened:
    """Open a scene by name, TOML file or mesh file, with balls to throw.

    Parameters
    ----------
    target : str or path
        A shipped scene's name, the path of a scene file (.toml), or that of a mesh.
    bodies, seed, up, repair, wrap
        For a mesh, as for `drop_scene`.

    Raises
    ------
    SceneError
        If there is no such scene or file, or it is invalid.
    MeshError
        If a mesh cannot be read or does not suit the layout.
    """
    load: Callable[..., Scene] = functools.partial(load_scene, target)
    file = scene_path(target) if is_scene(target) else None
    if file is None:
        load = functools.partial(
            drop_scene, target, bodies=bodies, seed=seed, up=up, repair=repair, wrap=wrap
        )
    scene = load()
    size = surface_size(scene)
    first = scene.targets[0]
    suited = suited_targets(scene.model, {first.geom: first.material.material()}, {first.geom: 1})
    _, impulse = poke_strength(suited.materials[first.geom], size)
    # a ball that bounces back with half its speed gives 1.5 times its momentum: here that of a poke
    mass = impulse / (1.5 * _THROW_DISTANCE * size / FLIGHT)

    specs = []

    def edit(spec: mujoco.MjSpec) -> None:
        specs.append(spec.copy())
        # parked balls must not widen the camera's view
        spec.stat.extent = scene.model.stat.extent
        spec.stat.center = scene.model.stat.center
        add_balls(spec, BALLS, _BALL_RADIUS * size, mass)

    return Opened(load(edit=edit), file, specs[-1])


def surface_size(scene: Scene) -> float:
    """Longest extent of the smallest rippling surface [m]."""
    model = scene.model
    extents = []
    for target in (find_target(model, entry.geom) for entry in scene.targets):
        if is_geom(target, model):
            extent = 2 * model.geom_aabb[target, 3:]
        else:
            extent = np.ptp(SoftSurface(model, target).mesh.V, axis=0)
        extents.append(float(extent.max()))
    return min(extents)


def display_problem() -> str | None:
    """Why no window can be opened, or None. Wayland desktops serve X11 too, and set DISPLAY."""
    if not sys.platform.startswith("linux"):
        return None
    name = os.environ.get("DISPLAY")
    if not name:
        return "the environment variable DISPLAY is not set"
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return "the library libX11.so.6 is missing (on Debian and Ubuntu: apt-get install libx11-6)"
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return f"there is no X server at DISPLAY={name}"
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return None
