"""`make_collidable`: let a mesh geom collide as its true surface.

A convex collider is made of the convex parts of a geom's mesh, which CoACD finds and the user's
cache keeps. A flex collider is a rigid flex of the mesh's triangles.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
import itertools
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh
from ripple_sim.solver.cache import cache_path, make_room, mark_used
from ripple_sim.solver.files import atomic_write
from ripple_sim.solver.mesh.queries import ClosestPoints, RayScene
from ripple_sim.solver.mesh.topology import corner_angles
from ripple_sim.solver.texels.atlas_file import read_arrays, write_arrays

from .geoms import to_body
from .model import SPECULATIVE, part_name
from .target_mesh import target_mesh
from .target_warnings import GAP_TOLERANCE

_GEOM = mujoco.mjtGeom
ROUTES = ("auto", "sdf", "flex", "convex", "hull")

# Starting points of MuJoCo's search for contacts with a signed distance. Fewer miss contacts; its
# default of 40 takes five times as long.
SDF_INITPOINTS = 10

# The same where another geom is a mesh. MuJoCo makes room for as many contacts of a pair, but finds
# up to 50 with a mesh.
_MESH_INITPOINTS = 50

# CoACD's own threshold of concavity: parts then lie up to 2.5 % of a mesh's size off the surface.
# With a third of its usual iterations it finds as good cuts in half the time.
_DECOMPOSITION = {"threshold": 0.05, "mcts_iterations": 60, "seed": 0}

# Contact settings that the colliders of a geom take from it: numbers, and arrays.
_NUMBER_SETTINGS = ("contype", "conaffinity", "condim", "priority", "solmix", "gap")
_ARRAY_SETTINGS = ("friction", "solref", "solimp")

# Group of the colliders: MuJoCo's viewers and ours do not show it.
_HIDDEN_GROUP = 3

# Thicknesses of a flex over the mesh's size: the first within the tolerance is taken, or the last.
_THICKNESSES = (0.05, 0.04, 0.03, 0.02)

# Thickness of a sheet over its size, on either side.
_SHEET_THICKNESS = 0.01

# Thicknesses by which vertices at sharp corners move at most; those of a cube need 1.73.
_MAX_CORNER_SHIFT = 2.0

# Weight of the isotropic term over that of the triangles' planes: it settles the directions that
# they leave open.
_ISOTROPIC_WEIGHT = 1e-3

# Depth at which rays to the other side start, over the depth by which vertices move.
_RAY_START = 1e-3

# Share of the local thickness by which vertices move at most, so that opposite sides of a thin part
# stay apart.
_MAX_INSET_SHARE = 0.45

# Vertices of a flex inside a mesh [m], [n, 3], its triangles, and the margin that reaches to the
# surface [m].
FlexCore = tuple[NDArray[np.float64], NDArray[np.int64], float]


def make_collidable(spec: mujoco.MjSpec, geom: str, route: str = "auto") -> mujoco.MjsGeom:
    """Let a mesh geom collide as its true surface.

    Primitive geoms do so by themselves and are left as they are. For them and for hulls MuJoCo's
    speculative contacts are enabled if the version has them (from 4 on), so that fast geoms are
    stopped in time. SDF geoms have no speculative contacts.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled. An earlier route is undone, unless the call fails.
    geom : str
        Name of a geom, or "body/index" of an unnamed one, which gets that name. A geom that
        collides with nothing gets a contype and a conaffinity of 1. Other geoms of its body
        continue to collide.
    route : str
        How the geom collides:

        - "auto": "sdf" for a closed mesh, "flex" for an open one.
        - "sdf": as a signed distance, which MuJoCo computes when it compiles the model. It is right
          for geoms of all shapes, and for moving targets too. But planes meet the mesh's convex
          hull, and height fields do not meet it at all.
        - "flex": through a rigid flex of its triangles, with the geom's name and on its body; the
          geom itself keeps its looks and mass. Planes and height fields meet it too, and bodies
          meet an open mesh from both sides. The time of a step depends on the number of triangles,
          that of a signed distance on the number of bodies: on ten thousand triangles ten balls
          take a third of its time, and one ball takes twice its time. The flex is right for
          spheres, capsules and ellipsoids, and for cylinders and meshes that sink in by less than
          0.7 of its thickness (2 to 5 % of the mesh's size). Boxes may be thrown aside, and SDF
          geoms sink in; a warning names both. See `add_flex_collider`.
        - "convex": as the convex parts of its mesh, which are geoms of their own without mass.
          CoACD finds them in some ten seconds (needs the package coacd), and the user's cache keeps
          them. This is the most robust way: boxes stack on it, and all geoms meet it. It holds
          bodies up to 2.5 % of the mesh's size off the surface. For closed meshes. See
          `add_convex_collider`.
        - "hull": as its convex hull, which is MuJoCo's way for mesh geoms: fast, and right for
          convex meshes only.

    Returns
    -------
    mujoco.MjsGeom
        The geom.

    Raises
    ------
    SceneError
        For an unknown route or geom, a specification from which no collider can be made, or a
        package that is missing.
    MeshError
        If the mesh cannot be used.
    """
    if route not in ROUTES:
        raise SceneError(
            f"collision route must be one of {', '.join(map(repr, ROUTES))}, got {route!r}"
        )
    spec_geom = _find(spec, geom)
    is_mesh = bool(spec_geom.meshname)
    if is_mesh and route == "auto":
        model = _compiled(spec, spec_geom)
        route = "sdf" if target_mesh(model, model.geom(spec_geom.name).id).closed else "flex"
    # what can fail comes first: then nothing has been changed
    core = flex_core(mesh_on_body(spec, spec_geom)) if is_mesh and route == "flex" else None
    parts = convex_parts(mesh_on_body(spec, spec_geom)) if is_mesh and route == "convex" else None
    if not is_mesh or route in ("convex", "hull"):
        spec.option.enableflags |= SPECULATIVE
    if is_mesh:
        _remove_colliders(spec, spec_geom)
        spec_geom.type = _GEOM.mjGEOM_SDF if route == "sdf" else _GEOM.mjGEOM_MESH
    if not (spec_geom.contype or spec_geom.conaffinity):
        spec_geom.contype = 1
        spec_geom.conaffinity = 1
    if is_mesh and route == "sdf":
        _enlarge_sdf_search(spec, spec_geom.name)
    if core is not None:
        add_flex_collider(spec, spec_geom, core)
    if parts is not None:
        add_convex_collider(spec, spec_geom, parts)
    return spec_geom


def _enlarge_sdf_search(spec: mujoco.MjSpec, name: str) -> None:
    """Give MuJoCo's search for contacts with an SDF geom as many starting points as it needs."""
    others = [
        geom for geom in spec.geoms if geom.name != name and (geom.contype or geom.conaffinity)
    ]
    count = spec.option.sdf_initpoints
    if any(geom.meshname for geom in others):
        spec.option.sdf_initpoints = max(count, _MESH_INITPOINTS)
    else:
        spec.option.sdf_initpoints = min(count, SDF_INITPOINTS)


def _find(spec: mujoco.MjSpec, key: str) -> mujoco.MjsGeom:
    """The geom of a name, or of "body/index"; in the second case an unnamed geom gets that name."""
    named_geom = spec.geom(key)
    if named_geom is not None:
        return named_geom
    body_name, _, index = key.rpartition("/")
    body = spec.body(body_name) if body_name else None
    if body is not None and index.isdecimal() and int(index) < len(body.geoms):
        geom = body.geoms[int(index)]
        geom.name = geom.name or key
        return geom
    names = ", ".join(repr(other.name) for other in spec.geoms if other.name)
    raise SceneError(
        f"the specification has no geom {key!r}; its named geoms are {names or 'none'}"
    )


def convex_parts(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Vertices of the convex parts of a mesh [m], each [n, 3]; the same for the same mesh.

    Wei et al. 2022, "Approximate convex decomposition for 3D meshes with collision-aware concavity
    and tree search". Raises `SceneError` if the mesh is open, or the package coacd is missing.
    """
    if not mesh.closed:
        raise SceneError(
            f"the {mesh.name} is open and encloses no volume that has convex parts; its routes "
            "are 'flex' and 'hull'"
        )
    try:
        version = importlib.metadata.version("coacd")
    except importlib.metadata.PackageNotFoundError as error:
        raise SceneError(
            "the route 'convex' needs coacd, which is not installed; install it with: pip install "
            "'ripple-sim[convex]', or take another route, such as 'sdf'"
        ) from error
    path = cache_path(f"convex parts {version} {_DECOMPOSITION}", (mesh.V, mesh.F))
    with contextlib.suppress(OSError, ValueError, KeyError):
        stored = read_arrays(path)
        mark_used(path)
        return [stored[str(i)] for i in range(len(stored))]
    parts = _decomposed(mesh)
    # if the folder cannot be written, the next call takes as long, and nothing else is lost
    with (
        contextlib.suppress(OSError),
        atomic_write(path) as unfinished,
        unfinished.open("wb") as file,
    ):
        write_arrays(file, {str(i): part for i, part in enumerate(parts)})
    make_room(path)
    return parts


def _decomposed(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Vertices of the convex parts that CoACD finds."""
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(mesh.V, mesh.F), **_DECOMPOSITION)
    return [np.array(V, dtype=np.float64) for V, _ in parts]


def mesh_on_body(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> Mesh:
    """A geom's mesh in the frame of its body, as MuJoCo compiles it.

    Raises `SceneError` if the specification does not compile as it is, or would lose geoms that do
    not collide, and `MeshError` if the mesh has no triangle with an area.
    """
    if spec.compiler.discardvisual:
        raise SceneError(
            f"geom {geom.name!r} cannot have others collide for it: with discardvisual the "
            "compiler would discard it; set spec.compiler.discardvisual = False"
        )
    model = _compiled(spec, geom)
    index = model.geom(geom.name).id
    mesh = target_mesh(model, index)
    return dataclasses.replace(mesh, V=to_body(model, index, mesh.V))


def _compiled(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> mujoco.MjModel:
    """The compiled model of a copy of a specification, in which a geom does not collide.

    A geom that collides would need a signed distance, which takes long, or a convex hull, which a
    flat mesh does not have.
    """
    trial = spec.copy()
    trial.compiler.discardvisual = False
    trial_geom = trial.geom(geom.name)
    trial_geom.type = mujoco.mjtGeom.mjGEOM_MESH
    trial_geom.contype = 0
    trial_geom.conaffinity = 0
    try:
        return trial.compile()
    except ValueError as error:
        raise SceneError(
            f"the colliders of geom {geom.name!r} are made from its compiled mesh, but the "
            f"specification does not compile: {error}"
        ) from error


def add_convex_collider(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, parts: Sequence[NDArray[np.float64]]
) -> None:
    """Let a mesh geom collide through geoms of its convex parts, and no longer by itself.

    The new geoms are on its body, with its contact settings and no mass: mass and looks stay with
    the geom.

    Parameters
    ----------
    spec : mujoco.MjSpec
    geom : mujoco.MjsGeom
        Of type mesh.
    parts : sequence of float64 [k, 3]
        Vertices of each in the frame of its body [m]; see `convex_parts`.
    """
    for i, V in enumerate(parts):
        name = part_name(geom.name, i)
        # a thin part may have too little volume for MuJoCo to take an inertia from it
        spec.add_mesh(
            name=name, uservert=V.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        )
        geom.parent.add_geom(
            name=name,
            type=_GEOM.mjGEOM_MESH,
            meshname=name,
            mass=0.0,
            group=_HIDDEN_GROUP,
            margin=geom.margin,
            **{key: getattr(geom, key) for key in _NUMBER_SETTINGS},
            **{key: np.array(getattr(geom, key)) for key in _ARRAY_SETTINGS},
        )
    geom.contype = 0
    geom.conaffinity = 0


def add_flex_collider(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, core: FlexCore) -> None:
    """Let a mesh geom collide through a rigid flex of its triangles, and no longer by itself.

    The flex has the name of the geom. MuJoCo's contacts with a triangle are right as long as
    nothing penetrates it: they push along the shortest line between the two. A geom that has
    penetrated is pushed out through the nearest side, which is sideways for a flat geom with a
    triangle under its rim. So the triangles lie inside the surface, and a contact margin of the
    same thickness holds other geoms off: they meet the true surface. Sharp edges become rounded and
    thin parts thicker; the flex is as thick as possible (2 to 5 % of the mesh's size) without
    putting either off by more than 2 %.

    An open mesh is a sheet that can be hit from both sides: the triangles are its own, and the
    margin, 1 % of its size, holds geoms off either side.

    Parameters
    ----------
    spec : mujoco.MjSpec
    geom : mujoco.MjsGeom
        Of type mesh.
    core : FlexCore
        See `flex_core`.
    """
    V, F, thickness = core
    body = geom.parent
    body.name = body.name or f"body of {geom.name}"
    spec.add_flex(
        name=geom.name,
        dim=2,
        vertbody=[body.name],
        vert=V.ravel(),
        elem=F.ravel().astype(np.int32),
        radius=0.0,
        margin=geom.margin + thickness,
        group=_HIDDEN_GROUP,
        **{name: getattr(geom, name) for name in _NUMBER_SETTINGS},
        **{name: np.array(getattr(geom, name)) for name in _ARRAY_SETTINGS},
    )
    geom.contype = 0
    geom.conaffinity = 0


def _remove_colliders(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Remove the colliders of a geom, if it has any, and let it collide by itself again."""
    flex = spec.flex(geom.name)
    if flex is not None and set(flex.vertbody) == {geom.parent.name}:
        geom.contype = flex.contype
        geom.conaffinity = flex.conaffinity
        spec.delete(flex)
    for i in itertools.count():
        name = part_name(geom.name, i)
        part = spec.geom(name)
        if part is None or part.parent.name != geom.parent.name:
            break
        geom.contype = part.contype
        geom.conaffinity = part.conaffinity
        spec.delete(part)
        spec.delete(spec.mesh(name))


def flex_core(mesh: Mesh) -> FlexCore:
    """Vertices, triangles and margin of the flex collider of a mesh in the frame of its body."""
    size = float(np.ptp(mesh.V, axis=0).max())
    if not mesh.closed:
        return mesh.V, mesh.F, _SHEET_THICKNESS * size
    points = np.concatenate([mesh.V, mesh.V[mesh.F].mean(axis=1)])
    for share in _THICKNESSES:
        thickness = share * size
        core = inset(mesh, thickness)
        distances = ClosestPoints(core, mesh.F).distances(points)
        if np.abs(distances - thickness).max() <= GAP_TOLERANCE * size:
            break
    return core, mesh.F, thickness


def inset(mesh: Mesh, depth: float) -> NDArray[np.float64]:
    """Vertices [m], [n, 3], moved inwards by a depth [m].

    The planes of the vertices' triangles then lie deeper by `depth`. Where more than three planes
    meet, the remaining squared distances, weighted by the corners' angles, are least. Parts too
    thin for the depth keep a tenth of their thickness.
    """
    V = mesh.V
    F = mesh.F
    corners = V[F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    squares = np.zeros((len(V), 3, 3))
    sums = np.zeros((len(V), 3))
    weights = np.zeros(len(V))
    for k, angle in enumerate(corner_angles(V, F).T):
        np.add.at(
            squares, F[:, k], angle[:, None, None] * normals[:, :, None] * normals[:, None, :]
        )
        np.add.at(sums, F[:, k], angle[:, None] * normals)
        np.add.at(weights, F[:, k], angle)
    squares += _ISOTROPIC_WEIGHT * weights[:, None, None] * np.eye(3)
    outward = (1 + _ISOTROPIC_WEIGHT) * np.linalg.solve(squares, sums[:, :, None])[:, :, 0]
    length = np.maximum(np.linalg.norm(outward, axis=1), np.finfo(np.float64).tiny)
    outward /= length[:, None]
    # to the other side of the mesh, infinite where there is none [m]; rays start inside
    start_depth = _RAY_START * depth
    _, distances, _, _ = RayScene(V, F).cast(V - start_depth * outward, -outward)
    thickness = start_depth + distances
    shift = depth * np.minimum(length, _MAX_CORNER_SHIFT)
    shift = np.minimum(shift, _MAX_INSET_SHARE * thickness)
    return V - shift[:, None] * outward
