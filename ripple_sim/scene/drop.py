"""A default scene around any mesh: the target on a floor, and bodies that drop on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.colliders import make_collidable
from ripple_sim.errors import SceneError
from ripple_sim.solver import Material, Mesh, load_mesh
from ripple_sim.solver.texels.thickness import half_thickness_at

from .body_shapes import BODY_SHAPES
from .camera import CameraEntry
from .drop_model import TYPICAL_FOOTPRINT, TYPICAL_HIT, drop_model
from .events import Events
from .load_scene import Edit, refusal_of
from .material_entry import COEFFICIENTS, MaterialEntry
from .paint import paint_target
from .scene import Scene
from .scene_file import RippleEntry
from .up_axis import UP_AXES, usual_up

SIZE = 1.0  # the target's longest edge of its bounding box [m]
DURATION = 5.0

# Depth of a typical hit over half the usual thickness of the target, and at most over its size.
_AMPLITUDE, _DEEPEST = 0.9, 0.2

_FLAT, _LIFTED = 1e-6, 0.25  # thickness over size of what lies down; how high, so that waves have room below [m]


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

    The mesh is scaled to a longest extent of 1 m and stands on a floor; bodies collide with its true surface, as a
    signed distance if it is closed, as a sheet with two sides if it is open.

    Parameters
    ----------
    mesh_path : path
    bodies, seed : int
        How many drop, 0 to 100, over the first 3.5 seconds; of their sizes, places and colours.
    up : str, optional
        Axis of the file that points up, "y" or "z". By default a flat sheet lies down; else see `usual_up`.
    look : str
        Of the target.
    texture : path, optional
        Image in place of the look's colour; by default see `mesh_image`.
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
    if not 0 <= bodies <= 100:
        raise SceneError(f"the number of bodies is {bodies}; valid is 0 to 100")
    if up is not None and up not in UP_AXES:
        raise SceneError(f"the up axis is {up!r}; valid are {' and '.join(map(repr, UP_AXES))}")
    mesh = load_mesh(mesh_path, **reading)
    up = up or _flat_along(mesh) or usual_up(mesh_path)
    V = _standing(mesh, up)
    # MuJoCo may throw boxes and cylinders aside from a sheet
    shapes = [shape for shape in BODY_SHAPES if mesh.closed or shape not in ("box", "cylinder")]
    spec, drops = drop_model(V, mesh.F, [shapes[i % len(shapes)] for i in range(bodies)], np.random.default_rng(seed))
    if not mesh.closed:
        make_collidable(spec, "target", "flex")
    paint_target(spec, mesh, mesh_path, texture)
    if edit is not None:
        edit(spec)
    with refusal_of(f"the mesh {str(mesh_path)!r}"):
        model = spec.compile()
    return Scene(
        name=Path(mesh_path).stem,
        model=model,
        targets=(RippleEntry(geom="target", look=look, material=_material(mesh), warn=False),),
        camera=_camera(float(V[:, 2].max())),
        duration=DURATION,
        events=Events(drop=tuple(drops)),
        notes=mesh.notes,
    )


def _material(mesh: Mesh) -> MaterialEntry:
    """Waves slow and high enough to watch under typical bodies, and lower on a thin target."""
    amplitude = min(_AMPLITUDE * _usual_radius(mesh), _DEEPEST)
    suited = Material.suited(SIZE, TYPICAL_HIT, radius=TYPICAL_FOOTPRINT, amplitude=amplitude, crossing=1.5, decay=3.0)
    return MaterialEntry(**{name: getattr(suited, name) for name in COEFFICIENTS if np.isfinite(getattr(suited, name))})


def _usual_radius(mesh: Mesh) -> float:
    """Median of the half thickness over the surface, as a share of the longest extent."""
    corners = mesh.V[mesh.F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(doubled, np.finfo(float).tiny)[:, None]
    radius = half_thickness_at(mesh, corners.mean(axis=1), normals)
    order = np.argsort(radius)
    reached = np.cumsum(doubled[order])
    return float(radius[order[np.searchsorted(reached, reached[-1] / 2)]] / np.ptp(mesh.V, axis=0).max())


def _camera(height: float) -> CameraEntry:
    """Camera that circles a target of a height [m]."""
    return CameraEntry(
        lookat=(0.0, 0.0, 0.95 * (height / 2)), distance=3.6, azimuth=125.0, elevation=-17.0, fovy=28.0, orbit=5.0
    )


def _flat_along(mesh: Mesh) -> str | None:
    """Axis along which a mesh has no extent, if it is one that can point up."""
    extents = np.ptp(mesh.V, axis=0)
    return next((axis for axis in UP_AXES if extents["xyz".index(axis)] <= _FLAT * extents.max()), None)


def _standing(mesh: Mesh, up: str) -> NDArray[np.float64]:
    """Vertices scaled, turned upright, standing on z = 0 over the origin, or hovering if they lie flat [m]."""
    V = mesh.V if up == "z" else mesh.V[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    V = V * (SIZE / np.ptp(V, axis=0).max())
    low, high = V.min(axis=0), V.max(axis=0)
    clearance = _LIFTED if high[2] - low[2] <= _FLAT * SIZE else 0.0
    return V - [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] - clearance]
