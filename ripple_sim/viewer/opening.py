"""Opening a scene or a mesh in the viewer, with balls to throw at it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from ripple_sim.coupling.geoms import find_target
from ripple_sim.coupling.soft import SoftSurface
from ripple_sim.coupling.soft_ids import is_soft
from ripple_sim.coupling.suited_target import suited_targets
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scene.find_scene import is_scene
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.solver import Material

from .balls import add_balls

BALLS = 6

# Relative to a surface's size: a ball's radius, a poke's radius, and a poke's depth.
_BALL, _POKE, _DEPTH = 0.06, 0.06, 0.025
# Time of flight of a thrown ball [s], and the distance it covers, in sizes of the surface.
FLIGHT = 0.5
_THROW = 3.0


@dataclasses.dataclass(frozen=True)
class Strength:
    """A poke.

    Attributes
    ----------
    radius : float
        Footprint radius of a poke [m].
    impulse : float
        Presses the surface in by a few per cent of its size [N s].
    """

    radius: float
    impulse: float


def poke_strength(material: Material, size: float) -> Strength:
    """A suitable poke for a surface of a size [m].

    The footprint (1 - (d / r)^2)^3 has its peak at 4 / (pi r^2), so an impulse J sets its middle moving at
    4 J / (pi r^2 sigma); it swings back at about omega^2 = (2 c / r)^2 + k.
    """
    radius = _POKE * size
    speed, stiffness, density = (
        float(np.max(value)) for value in (material.speed, material.stiffness, material.density)
    )
    omega = np.hypot(2 * speed / radius, np.sqrt(stiffness))
    # nothing pulls a surface without stiffness back: it then gets a second
    return Strength(radius, _DEPTH * size * density * np.pi * radius**2 / 4 * max(float(omega), 1.0))


def open_scene(
    target: str | Path,
    *,
    bodies: int = 3,
    seed: int = 0,
    up: str | None = None,
    repair: bool = False,
    wrap: bool = False,
) -> Scene:
    """Scene by name, TOML file or mesh file, with balls to throw.

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
    load: Callable[..., Scene] = (
        functools.partial(load_scene, target)
        if is_scene(target)
        else functools.partial(drop_scene, target, bodies=bodies, seed=seed, up=up, repair=repair, wrap=wrap)
    )
    scene = load()
    size = surface_size(scene)
    first = scene.targets[0]
    materials, _ = suited_targets(scene.model, {first.geom: first.material.material()}, {first.geom: 1})
    impulse = poke_strength(materials[first.geom], size).impulse
    # a ball that bounces back with half its speed gives 1.5 times its momentum: here that of a poke
    mass = impulse / (1.5 * _THROW * size / FLIGHT)

    def edit(spec: mujoco.MjSpec) -> None:
        # parked balls must not widen the camera's view
        spec.stat.extent, spec.stat.center = scene.model.stat.extent, scene.model.stat.center
        add_balls(spec, BALLS, _BALL * size, mass)

    return load(edit=edit)


def surface_size(scene: Scene) -> float:
    """Longest extent of the smallest rippling surface [m]."""
    targets = [find_target(scene.model, entry.geom) for entry in scene.targets]
    return min(_extent(scene.model, target) for target in targets)


def _extent(model: mujoco.MjModel, target: int) -> float:
    if is_soft(model, target):
        return float(np.ptp(SoftSurface(model, target).mesh.V, axis=0).max())
    return float(2 * model.geom_aabb[target, 3:].max())
