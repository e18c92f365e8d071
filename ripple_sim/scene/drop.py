"""A default scene around any mesh: the target on a floor, and bodies that drop on it.

The target shows most of itself, and stands as its format has it, or as it stands best.
"""

from __future__ import annotations

import numbers
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.colliders import make_collidable
from ripple_sim.coupling.suited import Extent
from ripple_sim.errors import SceneError
from ripple_sim.render.camera import Camera
from ripple_sim.solver import Material, Mesh, load_mesh
from ripple_sim.solver.errors import shown
from ripple_sim.solver.mesh.queries import RayScene

from .bodies import BODY_SHAPES, TYPICAL_FOOTPRINT, TYPICAL_HIT, drop_model
from .camera_entry import CameraEntry
from .events import Events
from .loading import Edit, load_scene, refusal_of
from .material_entry import COEFFICIENTS, MaterialEntry
from .paint import paint_target
from .scene import Scene
from .scene_file import RippleEntry
from .source import scene_path, shipped_scenes

# Axes of a file that may point up.
UP_AXES = ("y", "z")

# The target's longest edge of its bounding box [m].
SIZE = 1.0

# Of the scene [s].
DURATION = 5.0

# Depth of a typical hit: over half the usual thickness of the target, and over the radius of a tube
# that is as slender.
_DEPTH_OVER_THICKNESS = 5.6
_DEPTH_OVER_RADIUS = 2.8

# The same at most over the size, of a closed target and of one with rims, at which waves are twice
# as high.
_MAX_DEPTH = 0.2
_MAX_DEPTH_OPEN = 0.12

# Times in which waves cross the target and fall to a tenth, for `Material.suited` [s].
_CROSSING_TIME = 1.5
_DECAY_TIME = 2.5

# Stiff enough for crest behind crest [1/s^2].
_MIN_STIFFNESS = 1000.0

# Tubes of this radius, over the size, get bodies of the usual size; more slender ones get smaller
# bodies, down to the second share of the usual size.
_SLENDER_RADIUS = 0.05
_MIN_BODY_SCALE = 0.5

# How high over the floor what touches the floor may be, over the size.
_FOOT_HEIGHT = 0.02

# Thickness over size of a mesh that lies down.
_FLAT_THICKNESS = 1e-6

# Height of a mesh that lies down over the floor, so that waves have room below [m].
_FLAT_CLEARANCE = 0.25

# Azimuths of the camera to choose from: three-quarter views, first those of what faces -y, as most
# files have it [degrees].
_AZIMUTHS = (125.0, 55.0, 145.0, 35.0, 215.0, 325.0, 235.0, 305.0)

# Elevation of the camera on a target that lies flat, and on one that is as high as it is wide, or
# higher [degrees].
_FLAT_ELEVATION = -50.0
_HIGH_ELEVATION = -26.0

# Vertical field of view of the camera [degrees].
_FOVY = 28.0

# By which the camera circles [degrees/s].
_ORBIT = 5.0

# Height and width of the frame that the target may fill.
_FILLED = (0.62, 0.8)

# How far the target is below the middle of the frame, over its height, for the falls above it.
_BELOW_MIDDLE = 0.06

# Width of a frame over its height.
_ASPECT = 16 / 9

# Points of the surface by which views are compared.
_VIEW_POINTS = 1500

# Least upward part of the normal of what bodies fall on.
_MIN_TOP_NORMAL = 0.4


def usual_up(path: str | Path) -> str:
    """Axis that usually points up in files of this format: "z" for STL, else "y"."""
    return "z" if Path(path).suffix.lower() == ".stl" else "y"


def drop_scene(
    mesh_path: str | Path,
    *,
    bodies: int = 12,
    seed: int = 0,
    up: str | None = None,
    look: str = "rubber",
    texture: str | Path | None = None,
    edit: Edit | None = None,
    **reading: bool,
) -> Scene:
    """Scene in which bodies of several shapes drop on a mesh.

    The mesh is scaled to a longest extent of 1 m and stands on a floor; bodies collide with its
    true surface, as a signed distance if it is closed, as a sheet with two sides if it is open.

    Parameters
    ----------
    mesh_path : path
    bodies : int
        How many drop, 0 to 100, over the first 3.5 seconds.
    seed : int
        Of their sizes, places and colours.
    up : str, optional
        Axis of the file that points up, "y" or "z". By default a flat sheet lies down; else see
        `usual_up`, unless the mesh would fall over on that axis, and stands on the other.
    look : str
        Of the target.
    texture : path, optional
        Image instead of the look's colour; for the default see `paint_target`.
    edit : callable, optional
        Changes the model's specification in place, before it is compiled.
    **reading : bool
        `repair` and `wrap`, as for `load_mesh`.

    Raises
    ------
    MeshError
        If the mesh cannot be read.
    SceneError
        For any other invalid argument, or if MuJoCo refuses the mesh.
    """
    if not (isinstance(bodies, numbers.Integral) and 0 <= int(bodies) <= 100):
        raise SceneError(f"the number of bodies must be 0 to 100, got {shown(bodies)}")
    if up is not None and up not in UP_AXES:
        raise SceneError(f"the up axis must be {' or '.join(map(repr, UP_AXES))}, got {up!r}")
    mesh = load_mesh(mesh_path, **reading)
    V = _standing(mesh, up or _up(mesh, usual_up(mesh_path)))
    camera, eye = _camera(V, mesh.F, mesh.closed)
    # MuJoCo may throw boxes and cylinders aside from a sheet
    shapes = [shape for shape in BODY_SHAPES if mesh.closed or shape not in ("box", "cylinder")]
    extent = Extent.of(mesh)
    slender = _slenderness(mesh, extent)
    scale = float(np.clip(slender / _SLENDER_RADIUS, _MIN_BODY_SCALE, 1.0))
    material = _material(mesh, extent, slender, scale)
    rng = np.random.default_rng(seed)
    body_shapes = [shapes[i % len(shapes)] for i in range(bodies)]
    spec, drops = drop_model(V, mesh.F, body_shapes, rng, eye, scale)
    if not mesh.closed:
        make_collidable(spec, "target", "flex")
    not_shown = paint_target(spec, mesh, mesh_path, texture)
    if edit is not None:
        edit(spec)
    with refusal_of(f"the mesh {str(mesh_path)!r}"):
        model = spec.compile()
    return Scene(
        name=Path(mesh_path).stem,
        model=model,
        targets=(RippleEntry(geom="target", look=look, material=material, warn=False),),
        camera=camera,
        duration=DURATION,
        events=Events(drop=tuple(drops)),
        notes=(*mesh.notes, *not_shown),
    )


def _slenderness(mesh: Mesh, extent: Extent) -> float:
    """Radius over length of a tube as slender as a mesh.

    A tube has as much surface per length as a strip, and a hit sets this surface in motion.
    """
    rim_length = 0.0
    for rim in mesh.rims:
        around = mesh.V[[*rim, rim[0]]]
        rim_length += float(np.linalg.norm(np.diff(around, axis=0), axis=1).sum())
    return extent.area / (np.pi * max(rim_length, 2 * extent.size) * extent.size)


def _material(mesh: Mesh, extent: Extent, slender: float, scale: float) -> MaterialEntry:
    """Waves slow and high enough to watch under typical bodies of a scale, crest behind crest."""
    mass, speed = TYPICAL_HIT
    amplitude = min(
        _DEPTH_OVER_THICKNESS * extent.radius / extent.size,
        _DEPTH_OVER_RADIUS * slender,
        _MAX_DEPTH if mesh.closed else _MAX_DEPTH_OPEN,
    )
    suited = Material.suited(
        SIZE,
        (mass * scale**3, speed),
        radius=TYPICAL_FOOTPRINT * scale,
        amplitude=amplitude,
        crossing=_CROSSING_TIME,
        decay=_DECAY_TIME,
    )
    coefficients = {}
    for name in COEFFICIENTS:
        value = getattr(suited, name)
        if np.isfinite(value):
            coefficients[name] = value
    coefficients["stiffness"] = max(_MIN_STIFFNESS, coefficients["stiffness"])
    return MaterialEntry(**coefficients)


class _View(NamedTuple):
    """A view of a target.

    Attributes
    ----------
    score : float
        How much it shows; the highest is the best.
    azimuth : float
        [degrees]
    lookat : tuple of float
        Point to look at [m].
    distance : float
        Of the eye from there [m].
    eye : float64 [3]
        [m]
    """

    score: float
    azimuth: float
    lookat: tuple[float, float, float]
    distance: float
    eye: NDArray[np.float64]


def _camera(
    V: NDArray[np.float64], F: NDArray[np.int64], closed: bool
) -> tuple[CameraEntry, NDArray[np.float64]]:
    """The three-quarter view that shows most of a target, and the eye half-way of the orbit [m].

    It fills the frame, shows the upper side, the head, which is what is uppermost where that is not
    over the middle, or what leans out over the base, and the details: many vertices, and normals in
    many directions. Their variety is the entropy of those that are seen (as in Page et al. 2003,
    "Shape analysis algorithm based on information theory").
    """
    width, depth, height = np.ptp(V, axis=0)
    upright = min(height / max(width, depth), 1.0)
    elevation = _FLAT_ELEVATION + (_HIGH_ELEVATION - _FLAT_ELEVATION) * upright
    points, normals = _sampled(V, F)
    corners = V[:: -(-len(V) // _VIEW_POINTS)]
    upper = points[points[:, 2] >= np.quantile(points[:, 2], 0.9)]
    base = points[points[:, 2] <= np.quantile(points[:, 2], 0.1)]
    # direction from the middle of the base to the part that is uppermost, or leans out
    head = (upper.mean(axis=0) - base.mean(axis=0))[:2] / SIZE
    is_top = normals[:, 2] > _MIN_TOP_NORMAL
    # number of the direction of each normal, in boxes of 2/3
    bins = np.rint(1.5 * normals).astype(int) @ [25, 5, 1] + 62
    scene = RayScene(V, F)
    views = []
    for azimuth in _AZIMUTHS:
        lookat, distance, eye = _fitted(V, azimuth, elevation)
        rays = eye - points
        cosine = np.einsum("ij,ij->i", rays, normals) / np.linalg.norm(rays, axis=1)
        outer = normals * np.sign(cosine)[:, None]
        is_clear = scene.distances(points + 1e-4 * SIZE * outer, rays) > 1
        seen = is_clear & ((cosine > 0) | (not closed))
        # area that each point stands for in the picture
        shown = np.where(seen, np.abs(cosine), 0.0) / distance**2
        shares = np.bincount(bins, weights=shown) / max(shown.sum(), 1e-300)
        variety = -(shares * np.log(np.maximum(shares, 1e-300))).sum()
        top = seen[is_top].mean() if is_top.any() else 0.0
        towards = (eye - lookat)[:2] / distance
        detail = (scene.distances(corners + 1e-3 * (eye - corners), eye - corners) > 1).mean()
        score = variety + top + 2 * head @ towards + np.log(max(shown.sum() * detail, 1e-300))
        views.append(_View(score, azimuth, tuple(lookat.tolist()), distance, eye))
    best = max(views, key=lambda view: view.score)
    entry = CameraEntry(
        lookat=best.lookat,
        distance=best.distance,
        azimuth=best.azimuth - _ORBIT * DURATION / 2,
        elevation=float(elevation),
        fovy=_FOVY,
        orbit=_ORBIT,
    )
    return entry, best.eye


def _sampled(
    V: NDArray[np.float64], F: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points spread evenly over a surface, [k, 3], and its unit normals there, [k, 3]."""
    a, b, c = np.moveaxis(V[F], 1, 0)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    rng = np.random.default_rng(0)
    picked = rng.choice(len(F), _VIEW_POINTS, p=areas / areas.sum())
    weights = rng.dirichlet((1.0, 1.0, 1.0), _VIEW_POINTS)
    return np.einsum("ij,ijk->ik", weights, V[F[picked]]), normals[picked] / areas[picked, None]


def _fitted(
    V: NDArray[np.float64], azimuth: float, elevation: float
) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
    """View in which a target fills its share of the frame.

    Returns the point to look at [m], the distance from there [m], and the eye [m].
    """
    lookat = (V.min(axis=0) + V.max(axis=0)) / 2
    distance = 3 * SIZE
    tangent = np.tan(np.radians(_FOVY) / 2)
    spans = 2 * tangent * np.array([_ASPECT * _FILLED[1], _FILLED[0]])
    for _ in range(8):  # by then it changes by less than a pixel
        pose = Camera(tuple(lookat.tolist()), distance, azimuth, elevation, _FOVY).pose()
        local = (V - pose.position) @ pose.rotation
        seen = local[:, :2] / -local[:, 2:]
        low = seen.min(axis=0)
        high = seen.max(axis=0)
        middle = (low + high) / 2 + [0.0, 2 * tangent * _BELOW_MIDDLE]
        lookat = lookat + pose.rotation[:, :2] @ middle * distance
        distance *= float(((high - low) / spans).max())
    return lookat, distance, pose.position


def _up(mesh: Mesh, usual: str) -> str:
    """Axis that is to point up.

    A flat mesh lies down, so it is the axis along which the mesh has no extent. Otherwise it is the
    usual axis, unless the mesh falls over on that one and stands on the other.
    """
    extents = np.ptp(mesh.V, axis=0)
    for axis in UP_AXES:
        if extents["xyz".index(axis)] <= _FLAT_THICKNESS * extents.max():
            return axis
    falls = {axis: _falls(_standing(mesh, axis), mesh.F) for axis in UP_AXES}
    return min(UP_AXES, key=lambda axis: (falls[axis], axis != usual))


def _falls(V: NDArray[np.float64], F: NDArray[np.int64]) -> bool:
    """Whether a mesh that stands falls over.

    It does if the middle of its surface is not above what touches the floor, give or take.
    """
    middle = _sampled(V, F)[0].mean(axis=0)[:2]
    feet = V[V[:, 2] <= _FOOT_HEIGHT * SIZE][:, :2] - middle
    angles = np.sort(np.arctan2(feet[:, 1], feet[:, 0]))
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    return not gaps.max() < np.pi


def _standing(mesh: Mesh, up: str) -> NDArray[np.float64]:
    """Vertices scaled, turned upright, and standing on z = 0 over the origin [m].

    A mesh that lies flat hovers above the floor.
    """
    V = mesh.V if up == "z" else mesh.V[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    V = V * (SIZE / np.ptp(V, axis=0).max())
    low = V.min(axis=0)
    high = V.max(axis=0)
    clearance = _FLAT_CLEARANCE if high[2] - low[2] <= _FLAT_THICKNESS * SIZE else 0.0
    return V - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] - clearance]


def find_scene(target: str | Path, *, seed: int | None = None) -> Scene:
    """Scene of a shipped scene's name, a TOML file or a mesh file.

    Parameters
    ----------
    target : str or path
    seed : int, optional
        As for `load_scene`, or of `drop_scene`.

    Raises
    ------
    SceneError
        If there is no such scene or file, or it is invalid.
    MeshError
        If a mesh cannot be read.
    """
    return load_scene(target, seed=seed) if is_scene(target) else drop_scene(target, seed=seed or 0)


def is_scene(target: str | Path) -> bool:
    """Whether a target is a scene, by its name or its file, and not a mesh.

    Raises `SceneError` if there is neither.
    """
    path = Path(target)
    if str(target) in shipped_scenes() or path.suffix.lower() == ".toml":
        scene_path(target)
        return True
    if path.is_file():
        return False
    raise SceneError(
        f"there is no scene or mesh {str(target)!r}; shipped scenes are "
        f"{', '.join(shipped_scenes())}, or give the path of a scene file (TOML) or of a mesh"
    )
