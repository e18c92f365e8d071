"""Convex colliders, made so that a mesh geom collides as the convex parts of its mesh."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError

from .convex_colliders import part_name
from .convex_decomposition import convex_parts
from .mesh_in_spec import LISTS, SETTINGS, mesh_on_body

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
