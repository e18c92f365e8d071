"""The MuJoCo model of a default scene: a target on a floor, and bodies that drop on it.

The bodies are parked above the target until they drop. `randomize` varies the free bodies of any
model by a seed (domain randomisation).
"""

from __future__ import annotations

import colorsys

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.mesh.queries import RayScene, downward_hits

from .events import DropEntry

_GEOM = mujoco.mjtGeom

# Type and half-sizes over the body's radius, by name of a shape.
BODY_SHAPES = {
    "sphere": (_GEOM.mjGEOM_SPHERE, (1.0, 0.0, 0.0)),
    "box": (_GEOM.mjGEOM_BOX, (0.8, 0.8, 0.8)),
    "capsule": (_GEOM.mjGEOM_CAPSULE, (0.65, 0.85, 0.0)),
    "ellipsoid": (_GEOM.mjGEOM_ELLIPSOID, (1.2, 0.9, 0.7)),
    "cylinder": (_GEOM.mjGEOM_CYLINDER, (0.9, 0.5, 0.0)),
}

# Hues of the bodies in turn, 0 to 1.
_HUES = (0.01, 0.48, 0.60, 0.08, 0.82, 0.36)

# Range of the bodies' radii [m].
_RADII = (0.05, 0.085)

# Density of the bodies [kg/m^3].
_DENSITY = 400.0

# Range of the heights above the target from which bodies fall [m].
_HEIGHTS = (0.8, 1.2)

# Standard gravity, as in MuJoCo's default [m/s^2].
_GRAVITY = 9.81

# When the first body begins to fall, and the time within which all of them do [s].
_FIRST_FALL = 0.1
_FALLING_TIME = 3.4

# Distance between the middles of bodies that fall one after the other [m].
_CLEARANCE = 0.2

# Height at which the first body is parked; the others are a metre above one another [m].
_PARKED_HEIGHT = 20.0

# Least upward part of the normal of a good landing point.
_MIN_UPWARD = 0.6

# Room on all sides of a good landing point [m], and the directions in which room is measured.
_ROOM = 0.05
_DIRECTIONS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])

# Largest number of landing points that are tried: there may be no good one.
_MAX_TRIED_POINTS = 1000

# Points that are tried in a round, and the largest number of rounds: next to nothing of an upright
# sheet can be hit from above.
_POINTS_PER_ROUND = 64
_MAX_ROUNDS = 200

# Start of a ray of sight above the surface that it leaves [m].
_RAY_OFFSET = 1e-3

# Mass [kg] and speed [m/s] with which a ball of mean radius falls on the target.
_MEAN_RADIUS = (_RADII[0] + _RADII[1]) / 2
TYPICAL_HIT = (
    _DENSITY * 4 / 3 * np.pi * _MEAN_RADIUS**3,
    float(np.sqrt(2 * _GRAVITY * sum(_HEIGHTS) / 2)),
)

# Radius of the ball's footprint [m].
TYPICAL_FOOTPRINT = _MEAN_RADIUS / 2


def drop_model(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    shapes: list[str],
    rng: np.random.Generator,
    eye: NDArray[np.float64] | None = None,
    scale: float = 1.0,
) -> tuple[mujoco.MjSpec, list[DropEntry]]:
    """Model of a mesh on a floor, with bodies, and when and where these drop.

    Parameters
    ----------
    V : float64 [n, 3]
        Vertices of the target [m], standing on z = 0.
    F : int64 [m, 3]
    shapes : list of str
        Of the bodies; see `BODY_SHAPES`.
    rng : numpy.random.Generator
        Draws the bodies' sizes, places and colours.
    eye : float64 [3], optional
        Eye of the camera, from which the hits should be visible [m].
    scale : float
        Factor of the bodies' sizes.
    """
    spec = _target_on_floor(V, F)
    landing = _landing_points(V, F, len(shapes), rng, eye, _ROOM * scale)
    interval = _FALLING_TIME / max(len(shapes), 1)
    drops: list[DropEntry] = []
    previous = 0.0, 0.0, -np.inf  # where the body before begins to fall [m]
    for i, (shape, (x, y, z)) in enumerate(zip(shapes, landing.tolist(), strict=True)):
        kind, proportions = BODY_SHAPES[shape]
        radius = scale * rng.uniform(*_RADII)
        name = f"body_{i}"
        # parked high above until the body drops, out of sight and out of reach of the others
        parked = [0.0, 0.0, _PARKED_HEIGHT + i]
        body = spec.worldbody.add_body(name=name, pos=parked, quat=rng.standard_normal(4))
        body.add_freejoint()
        color = colorsys.hsv_to_rgb(
            _HUES[i % len(_HUES)], rng.uniform(0.6, 0.8), rng.uniform(0.7, 0.95)
        )
        body.add_geom(
            name=name,
            type=kind,
            size=[radius * proportion for proportion in proportions],
            density=_DENSITY,
            rgba=[*color, 1],
        )
        start = z + rng.uniform(*_HEIGHTS)
        # not into the body before, which has fallen for an interval by now
        if np.hypot(previous[0] - x, previous[1] - y) < _CLEARANCE:
            fallen = _GRAVITY / 2 * interval**2
            start = max(start, min(previous[2] - fallen + _CLEARANCE, z + _HEIGHTS[1]))
        previous = x, y, start
        drops.append(DropEntry(body=name, time=_FIRST_FALL + interval * i, position=previous))
    return spec, drops


def _target_on_floor(V: NDArray[np.float64], F: NDArray[np.int64]) -> mujoco.MjSpec:
    """Model of a mesh on a floor, without bodies."""
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.002
    # enough starting points to find the contacts of a body with a target, at a fifth of the
    # default's cost
    spec.option.sdf_initpoints = 8
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # springy contacts (restitution about 0.5): a spring of 0.01 s at a damping ratio of 0.2
    spec.default.geom.solref = [0.01, 0.2]
    spec.default.geom.friction = [0.4, 0.005, 0.0001]
    # MuJoCo needs four vertices, and a triangle has three: the added one is in no triangle
    vertices = V if len(V) >= 4 else np.vstack([V, V[:1]])
    # the inertia of a shell, since sheets have no volume
    spec.add_mesh(
        name="target",
        uservert=vertices.ravel(),
        userface=F.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(name="target", type=_GEOM.mjGEOM_SDF, meshname="target")
    floor = spec.worldbody.add_geom(
        name="floor", type=_GEOM.mjGEOM_PLANE, size=[12, 12, 0.1], condim=6
    )
    floor.rgba = [0.86, 0.87, 0.88, 1]
    floor.friction = [0.8, 0.01, 0.02]
    return spec


def _landing_points(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    count: int,
    rng: np.random.Generator,
    eye: NDArray[np.float64] | None,
    room: float,
) -> NDArray[np.float64]:
    """Random points of the surface to drop bodies on, [count, 3] [m].

    The points have nothing above them. Points that face upwards, have room about them [m] and are
    visible from the eye come first. Where there are too few points, vertices take their place.
    """
    scene = RayScene(V, F)
    low = V.min(axis=0)
    high = V.max(axis=0)
    points = np.empty((0, 3))
    merits = np.empty(0)  # of each point, 0 to 3
    for _ in range(_MAX_ROUNDS):
        if (merits == 3).sum() >= count or len(points) >= max(count, _MAX_TRIED_POINTS):
            break
        xy = rng.uniform(low[:2], high[:2], size=(_POINTS_PER_ROUND, 2))
        faces, z = downward_hits(scene, xy, high[2])
        is_hit = faces >= 0
        hits = np.column_stack([xy, z])[is_hit]
        faces_up = _faces_up(V[F[faces[is_hit]]])
        has_room = _has_room(scene, hits, high[2], room)
        is_visible = _is_visible(scene, hits, eye)
        points = np.vstack([points, hits])
        merits = np.append(merits, 1.0 * faces_up + has_room + is_visible)
    points = points[np.argsort(-merits, kind="stable")[:count]]
    return np.vstack([points, V[rng.integers(len(V), size=count - len(points))]])


def _faces_up(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether triangles, given by their corners [k, 3, 3], face upwards or downwards."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normals = np.cross(b - a, c - a)
    return np.abs(normals[:, 2]) > _MIN_UPWARD * np.linalg.norm(normals, axis=1)


def _has_room(
    scene: RayScene, points: NDArray[np.float64], top: float, room: float
) -> NDArray[np.bool_]:
    """Whether the surface stays near points [k, 3] in all directions.

    `top` is the height from which the surface is probed, and `room` the distance and the largest
    difference in height [m].
    """
    differences = []
    for step in room * _DIRECTIONS:
        _, heights = downward_hits(scene, points[:, :2] + step, top)
        differences.append(heights - points[:, 2])
    return np.asarray((np.abs(differences) < room).all(axis=0))


def _is_visible(
    scene: RayScene, points: NDArray[np.float64], eye: NDArray[np.float64] | None
) -> NDArray[np.bool_]:
    """Whether points [k, 3] of the surface are visible from an eye; without one all are."""
    rays = np.zeros_like(points) if eye is None else eye - points
    return scene.distances(points + np.array([0.0, 0.0, _RAY_OFFSET]), rays) > 1


class RandomEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[random]`: random variation of free bodies, by a seed."""

    seed: int = 0
    """Another seed, another variation; `render --seed` overrides it."""
    position: float = 0.0
    """Largest shift along each axis, of a body's place and of the place it is dropped or thrown
    from [m]."""
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
    free = {body.name: body for body in spec.bodies if _is_free(body)}
    for name in entry.bodies or ():
        if name not in free:
            raise SceneError(
                f"[random] names the body {name!r}; the model's free bodies are "
                f"{', '.join(free) or 'none'}"
            )
    rng = np.random.default_rng(entry.seed)
    shifts = {}
    names = free if entry.bodies is None else entry.bodies
    for name in names:
        shifts[name] = _vary(free[name], entry, rng)
    return shifts


def _vary(body: mujoco.MjsBody, entry: RandomEntry, rng: np.random.Generator) -> np.ndarray:
    """Vary one body; return its shift [m].

    Each body takes the same number of random numbers, whatever the entry asks for.
    """
    shift = rng.uniform(-entry.position, entry.position, 3)
    body.pos = body.pos + shift
    quaternion = rng.standard_normal(4)
    if entry.orientation:
        body.quat = quaternion / np.linalg.norm(quaternion)
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    # the logarithms of the factors are drawn evenly
    log_low, log_high = np.log([entry.size, entry.mass]).T
    size_factor, mass_factor = np.exp(rng.uniform(log_low, log_high))
    shape = rng.choice(entry.shapes) if entry.shapes else None
    for geom in body.geoms:
        if geom.meshname:
            continue
        if shape is not None:
            radius = float(np.max(geom.size))
            geom.type, proportions = BODY_SHAPES[shape]
            geom.size = radius * np.array(proportions)
        geom.size = geom.size * float(size_factor)
        if np.isfinite(geom.mass):
            geom.mass = geom.mass * float(mass_factor)
        else:
            geom.density = geom.density * float(mass_factor)
    return shift


def _is_free(body: mujoco.MjsBody) -> bool:
    """Whether a body has a free joint."""
    return any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in body.joints)


def _check(entry: RandomEntry) -> None:
    """Refuse ranges, seeds and shapes that are not valid."""
    for name, (low, high) in (("size", entry.size), ("mass", entry.mass)):
        if not 0 < low <= high < np.inf:
            raise SceneError(
                f"[random] {name} must be two positive factors, the lower one first, got "
                f"[{low!r}, {high!r}]"
            )
    if not 0 <= entry.position < np.inf:
        raise SceneError(f"[random] position must be 0 or greater, got {entry.position!r} m")
    if entry.seed < 0:
        raise SceneError(f"[random] seed must be 0 or greater, got {entry.seed}")
    for shape in entry.shapes:
        if shape not in BODY_SHAPES:
            raise SceneError(f"[random] shapes must be of {', '.join(BODY_SHAPES)}, got {shape!r}")
