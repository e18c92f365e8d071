"""The mesh of a geom that is not compiled yet."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh

from .target_mesh import target_mesh

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
