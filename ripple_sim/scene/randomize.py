"""Domain randomisation: the free bodies of a model varied by a seed."""

from __future__ import annotations

import msgspec
import mujoco
import numpy as np

from ripple_sim.errors import SceneError

from .body_shapes import BODY_SHAPES


class RandomEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[random]`: random variation of free bodies, by a seed."""

    seed: int = 0
    """Another seed, another variation; `render --seed` overrides it."""
    position: float = 0.0
    """Largest shift along each axis, of a body's place and of the place it is dropped or thrown from [m]."""
    orientation: bool = False
    """Whether to turn the bodies at random."""
    size: tuple[float, float] = (1.0, 1.0)
    """Range of factors."""
    mass: tuple[float, float] = (1.0, 1.0)
    """Range of factors."""
    shapes: list[str] = []
    """To choose from; none: unchanged."""
    bodies: list[str] | None = None
    """Names; by default all free ones."""


def randomize(spec: mujoco.MjSpec, entry: RandomEntry) -> dict[str, np.ndarray]:
    """Vary the free bodies of a model in place, before it is compiled.

    Returns
    -------
    dict
        How far each body was shifted [m], by name.

    Raises
    ------
    SceneError
        For an unknown body or shape, or an invalid range.
    """
    _check(entry)
    free = {body.name: body for body in spec.bodies if any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in body.joints)}
    for name in entry.bodies or ():
        if name not in free:
            raise SceneError(
                f"[random] names the body {name!r}; the model's free bodies are {', '.join(free) or 'none'}"
            )
    rng = np.random.default_rng(entry.seed)
    shifts = {}
    for name in entry.bodies if entry.bodies is not None else free:
        body = free[name]
        shifts[name] = rng.uniform(-entry.position, entry.position, 3)
        body.pos = body.pos + shifts[name]
        turn = rng.standard_normal(4)
        if entry.orientation:
            body.quat = turn / np.linalg.norm(turn)
            body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        size, mass = np.exp(rng.uniform(*np.log([entry.size, entry.mass]).T))
        kind = rng.choice(entry.shapes) if entry.shapes else None
        for geom in body.geoms:
            _vary(geom, float(size), float(mass), kind)
    return shifts


def _vary(geom: mujoco.MjsGeom, size: float, mass: float, kind: str | None) -> None:
    if geom.meshname:
        return
    if kind is not None:
        radius = float(np.max(geom.size))
        geom.type, proportions = BODY_SHAPES[kind]
        geom.size = radius * np.array(proportions)
    geom.size = geom.size * size
    if np.isfinite(geom.mass):
        geom.mass = geom.mass * mass
    else:
        geom.density = geom.density * mass


def _check(entry: RandomEntry) -> None:
    for name, (low, high) in (("size", entry.size), ("mass", entry.mass)):
        if not 0 < low <= high < np.inf:
            raise SceneError(
                f"[random] {name} is [{low!r}, {high!r}]; valid are two positive factors, the lower one first"
            )
    if not 0 <= entry.position < np.inf:
        raise SceneError(f"[random] position is {entry.position!r} m; valid is 0 or greater")
    if entry.seed < 0:
        raise SceneError(f"[random] seed is {entry.seed}; valid is 0 or greater")
    for shape in entry.shapes:
        if shape not in BODY_SHAPES:
            raise SceneError(f"[random] names the shape {shape!r}; valid are {', '.join(BODY_SHAPES)}")
