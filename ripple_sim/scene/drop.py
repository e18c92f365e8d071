"""A default scene around any mesh: the target on a floor, and bodies that drop on it.

`standing` turns the target upright, `drop_view` chooses the camera, and `bodies` makes the model.
"""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ripple_sim.coupling.colliders import make_collidable
from ripple_sim.coupling.suited import Extent
from ripple_sim.errors import SceneError
from ripple_sim.solver import Material, Mesh, load_mesh
from ripple_sim.solver.errors import shown

from .bodies import BODY_SHAPES, TYPICAL_FOOTPRINT, TYPICAL_HIT, drop_model
from .drop_view import drop_camera
from .events import Events
from .loading import Edit, check_scene, load_scene, refusal_of
from .material_entry import COEFFICIENTS, MaterialEntry
from .paint import paint_target
from .scene import Scene
from .scene_file import Color, RippleEntry
from .source import scene_path, shipped_scenes
from .standing import SIZE, UP_AXES, stand, states_front, states_up, usual_up

# Duration of the scene [s].
DURATION = 5.0

# Depth of a typical hit: over half the usual thickness of the target, and over the radius of a tube
# that is as slender.
_DEPTH_OVER_THICKNESS = 5.6
_DEPTH_OVER_RADIUS = 2.8

# Largest depth of a typical hit over the size: of a closed target, and of one with rims, at which
# waves are twice as high.
_MAX_DEPTH = 0.2
_MAX_DEPTH_OPEN = 0.12

# Times in which waves cross the target and fall to a tenth, for `Material.suited` [s].
_CROSSING_TIME = 1.5
_DECAY_TIME = 2.5

# Least stiffness of the surface [1/s^2]: with it a crest follows behind another.
_MIN_STIFFNESS = 1000.0

# Tubes of this radius, over the size, get bodies of the usual size. More slender tubes get smaller
# bodies, down to the second share of the usual size.
_SLENDER_RADIUS = 0.05
_MIN_BODY_SCALE = 0.5

# Shapes that MuJoCo may throw aside from a sheet.
_NOT_ON_SHEETS = ("box", "cylinder")

# Other names of shapes.
_SHAPE_ALIASES = {"ball": "sphere"}


def drop_scene(
    mesh_path: str | Path,
    *,
    bodies: int = 12,
    seed: int = 0,
    up: str | None = None,
    look: str = "rubber",
    color: Color | None = None,
    texture: str | Path | None = None,
    view: str | float | None = None,
    elevation: float | None = None,
    shapes: Sequence[str] | None = None,
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
        Number of bodies, 0 to 100, which drop over the first 3.5 seconds.
    seed : int
        Seed of their sizes, places and colours.
    up : str, optional
        Axis of the file that points up, "y" or "z". By default a sheet lies down: an open mesh in
        one part that is thinner than a third of its longest extent. Files of glTF, FBX and COLLADA
        state their up axis. For other meshes see `usual_up`, unless the mesh would fall over on
        that axis, and stands on the other.
    look : str
        Look of the target, one of `LOOKS`.
    color : (float, float, float), optional
        Colour of the target, sRGB, 0 to 1, in place of its texture, its vertices' colours or the
        look's.
    texture : path, optional
        Image instead of the look's colour; for the default see `paint_target`.
    view : str or float, optional
        "front", "left", "back", "right" or "top", or an azimuth [degrees]: where the camera is
        half-way of its orbit. By default a view that shows the front and where bodies land.
    elevation : float, optional
        Elevation of the camera [degrees]; negative looks down.
    shapes : sequence of str, optional
        Shapes of the bodies in turn, of `BODY_SHAPES`; a ball is a sphere. By default all, on open
        meshes without boxes and cylinders, which MuJoCo may throw aside there.
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
    body_shapes = _body_shapes(shapes, mesh.closed)
    V, note = stand(mesh, up, usual_up(mesh_path), states_up(mesh_path))
    has_front = states_front(mesh_path) and up != "z"
    camera, eye = drop_camera(V, mesh.F, mesh.closed, DURATION, view, elevation, has_front)
    extent = Extent.of(mesh)
    slenderness = _slenderness(mesh, extent)
    scale = float(np.clip(slenderness / _SLENDER_RADIUS, _MIN_BODY_SCALE, 1.0))
    material = _material(mesh, extent, slenderness, scale)
    rng = np.random.default_rng(seed)
    shapes_in_turn = [body_shapes[i % len(body_shapes)] for i in range(bodies)]
    spec, drops = drop_model(V, mesh.F, shapes_in_turn, rng, eye, scale)
    if not mesh.closed:
        make_collidable(spec, "target", "flex")
    notes = [*mesh.notes, *paint_target(spec, mesh, mesh_path, texture)]
    if note:
        notes.append(note)
    if edit is not None:
        edit(spec)
    with refusal_of(f"the mesh {str(mesh_path)!r}"):
        model = spec.compile()
    entry = RippleEntry(geom="target", look=look, color=color, material=material, warn=False)
    scene = Scene(
        name=Path(mesh_path).stem,
        model=model,
        targets=(entry,),
        camera=camera,
        duration=DURATION,
        events=Events(drop=tuple(drops)),
        notes=tuple(notes),
    )
    check_scene(scene)
    return scene


def _body_shapes(shapes: Sequence[str] | None, closed: bool) -> list[str]:
    """Shapes of the bodies in turn, of `BODY_SHAPES`; raises `SceneError` for an unknown one."""
    if shapes is None:
        return [shape for shape in BODY_SHAPES if closed or shape not in _NOT_ON_SHEETS]
    names = [_SHAPE_ALIASES.get(shape, shape) for shape in shapes]
    for name in names:
        if name not in BODY_SHAPES:
            raise SceneError(f"shape must be ball, {', '.join(BODY_SHAPES)}, got {shown(name)}")
    if not names:
        raise SceneError("no shape is given; name one or more, or leave shapes out")
    return names


def _slenderness(mesh: Mesh, extent: Extent) -> float:
    """Radius over length of a tube as slender as a mesh.

    A tube has as much surface per length as a strip, and a hit sets this surface in motion.
    """
    rim_length = 0.0
    for rim in mesh.rims:
        around = mesh.V[[*rim, rim[0]]]
        rim_length += float(np.linalg.norm(np.diff(around, axis=0), axis=1).sum())
    return extent.area / (np.pi * max(rim_length, 2 * extent.size) * extent.size)


def _material(mesh: Mesh, extent: Extent, slenderness: float, scale: float) -> MaterialEntry:
    """A material whose waves are slow and high enough to watch, crest behind crest.

    The waves are those of a typical hit by bodies of a scale.
    """
    mass, speed = TYPICAL_HIT
    amplitude = min(
        _DEPTH_OVER_THICKNESS * extent.radius / extent.size,
        _DEPTH_OVER_RADIUS * slenderness,
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


def find_scene(target: str | Path, *, seed: int | None = None) -> Scene:
    """Scene of a shipped scene's name, a TOML file or a mesh file.

    Parameters
    ----------
    target : str or path
    seed : int, optional
        As for `load_scene` or `drop_scene`.

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
