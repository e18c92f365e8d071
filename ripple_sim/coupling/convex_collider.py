"""Convex colliders, made so that a mesh geom collides as the convex parts of its mesh.

Decomposition of a mesh into convex parts, by CoACD, kept in the user's cache.

The mesh of a geom that is not compiled yet.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh
from ripple_sim.solver.cache import cache_path, make_room, mark_used
from ripple_sim.solver.files import atomic_write
from ripple_sim.solver.texels.atlas import read_arrays, write_arrays

from .model import part_name
from .target_mesh import target_mesh

# CoACD's own threshold of concavity: parts then lie up to 2.5 % of a mesh's size off the surface. With a third of its
# usual iterations it finds as good cuts in half the time.
_SETTINGS = {"threshold": 0.05, "mcts_iterations": 60, "seed": 0}


def convex_parts(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Vertices of the convex parts of a mesh [m], each [n, 3]; the same for the same mesh.

    Wei et al. 2022, "Approximate convex decomposition for 3D meshes with collision-aware concavity and tree search".

    Raises
    ------
    SceneError
        If the package coacd is missing.
    """
    try:
        version = importlib.metadata.version("coacd")
    except importlib.metadata.PackageNotFoundError as error:
        raise SceneError(
            "the route 'convex' needs coacd, which is not installed; install it with: pip install "
            "'ripple-sim[convex]', or take another route, such as 'sdf'"
        ) from error
    path = cache_path(f"convex parts {version} {_SETTINGS}", (mesh.V, mesh.F))
    with contextlib.suppress(OSError, ValueError, KeyError):
        stored = read_arrays(path)
        mark_used(path)
        return [stored[str(i)] for i in range(len(stored))]
    parts = _decompose(mesh)
    # a folder that cannot be written costs the next call its time, nothing else
    with contextlib.suppress(OSError), atomic_write(path) as unfinished, unfinished.open("wb") as file:
        write_arrays(file, {str(i): part for i, part in enumerate(parts)})
    make_room(path)
    return parts


def _decompose(mesh: Mesh) -> list[NDArray[np.float64]]:
    import coacd

    coacd.set_log_level("error")
    return [np.array(V, dtype=np.float64) for V, _ in coacd.run_coacd(coacd.Mesh(mesh.V, mesh.F), **_SETTINGS)]


# What a geom's stand-ins collide like.
SETTINGS = ("contype", "conaffinity", "condim", "priority", "solmix", "gap")
LISTS = ("friction", "solref", "solimp")


def mesh_on_body(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> Mesh:
    """A geom's mesh in the frame of its body, as MuJoCo compiles it.

    Raises
    ------
    SceneError
        If the specification does not compile as it is, or would lose geoms that do not collide.
    """
    if spec.compiler.discardvisual:
        raise SceneError(
            f"geom {geom.name!r} cannot have others collide for it: with discardvisual the compiler would discard it; "
            "set spec.compiler.discardvisual = False"
        )
    model = _compiled(spec, geom)
    index = model.geom(geom.name).id
    mesh, rotation = target_mesh(model, index), np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[index])
    return dataclasses.replace(mesh, V=model.geom_pos[index] + mesh.V @ rotation.reshape(3, 3).T)


def is_closed(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether a geom's mesh has no rim; raises SceneError if the specification does not compile."""
    model = _compiled(spec, geom)
    return target_mesh(model, model.geom(geom.name).id).closed


def _compiled(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> mujoco.MjModel:
    trial = spec.copy()
    # a signed distance would take long, and a flat mesh has no convex hull
    trial.compiler.discardvisual = False
    own = trial.geom(geom.name)
    own.type, own.contype, own.conaffinity = mujoco.mjtGeom.mjGEOM_MESH, 0, 0
    try:
        return trial.compile()
    except ValueError as error:
        raise SceneError(
            f"the colliders of geom {geom.name!r} are made from its compiled mesh, but the specification does not "
            f"compile: {error}"
        ) from error


# MuJoCo's viewers and ours do not show this group.
_HIDDEN = 3


def add_convex_collider(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, parts: Sequence[NDArray[np.float64]]) -> None:
    """Let a mesh geom collide through geoms of its convex parts, on its body, and no longer by itself.

    They have its contact settings and no mass: mass and looks stay with the geom.

    Parameters
    ----------
    spec : mujoco.MjSpec
    geom : mujoco.MjsGeom
        Of type mesh.
    parts : sequence of float64 [k, 3]
        Vertices of each [m]; see `convex_parts_of`.
    """
    for i, V in enumerate(parts):
        name = part_name(geom.name, i)
        # a thin part may have too little volume for MuJoCo to take an inertia from it
        spec.add_mesh(name=name, uservert=V.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        geom.parent.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            mass=0.0,
            group=_HIDDEN,
            margin=geom.margin,
            **{each: getattr(geom, each) for each in SETTINGS},
            **{each: np.array(getattr(geom, each)) for each in LISTS},
        )
    geom.contype = geom.conaffinity = 0


def convex_parts_of(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> list[NDArray[np.float64]]:
    """Vertices of the convex parts of a geom's mesh in the frame of its body [m].

    Raises
    ------
    SceneError
        If the mesh is open, the package coacd is missing, or the specification does not compile or discards geoms that
        do not collide.
    """
    mesh = mesh_on_body(spec, geom)
    if not mesh.closed:
        raise SceneError(
            f"the mesh of geom {geom.name!r} is open and encloses no volume that has convex parts; valid routes for it "
            "are 'flex' and 'hull'"
        )
    return convex_parts(mesh)


def remove_convex_collider(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Remove the convex colliders of a geom, if it has any, and let the geom collide by itself again."""
    i = 0
    while (part := spec.geom(part_name(geom.name, i))) is not None and part.parent.name == geom.parent.name:
        geom.contype, geom.conaffinity = part.contype, part.conaffinity
        spec.delete(part)
        spec.delete(spec.mesh(part_name(geom.name, i)))
        i += 1
