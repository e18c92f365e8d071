"""Shapes of visuals: which mesh each kind of geom is drawn as, and its sizes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from . import meshes, primitives
from .primitives import Shape
from .visual import Visual

_BEVEL = 0.06
_ENDLESS = 100.0  # half size of infinite planes, in extents of the model

_GEOM = mujoco.mjtGeom
# name, and a function that makes the shape with a number of segments to a right angle
NamedShape: TypeAlias = tuple[str, Callable[[int], Shape]]
_SHAPES: dict[int, NamedShape] = {
    _GEOM.mjGEOM_SPHERE: ("ball", primitives.ball),
    _GEOM.mjGEOM_ELLIPSOID: ("ball", primitives.ball),
    _GEOM.mjGEOM_CAPSULE: ("capsule", lambda n: primitives.capsule(4 * n, n)),
    _GEOM.mjGEOM_CYLINDER: ("cylinder", lambda n: primitives.cylinder(4 * n, 3)),
    _GEOM.mjGEOM_BOX: ("box", lambda n: primitives.box(min(n // 3, 3))),
    _GEOM.mjGEOM_PLANE: ("sheet", lambda n: primitives.sheet()),
}


def shape_of(model: Any, visual: Visual) -> NamedShape | None:
    """Name of a visual's shape, and a function that makes it with a number of segments to a right angle.

    None for other types.
    """
    kind, asset = visual.kind, visual.asset
    if kind in (_GEOM.mjGEOM_MESH, _GEOM.mjGEOM_SDF) and asset >= 0:
        return f"mesh {asset}", lambda _: meshes.mesh_asset(model, asset)
    if kind == _GEOM.mjGEOM_HFIELD and asset >= 0:
        return f"hfield {asset}", lambda _: meshes.height_field(model, asset)
    return _SHAPES.get(kind)


def sizes(model: Any, visual: Visual) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Core and shell size of a visual [m], shape [3] each (see primitives.py)."""
    half = visual.half_sizes
    match visual.kind:
        case _GEOM.mjGEOM_SPHERE | _GEOM.mjGEOM_ELLIPSOID:
            return np.zeros(3), half
        case _GEOM.mjGEOM_CAPSULE:
            return np.array([0.0, 0.0, half[2]]), np.full(3, half[0])
        case _GEOM.mjGEOM_PLANE:
            half = np.where(half > 0, half, _ENDLESS * model.stat.extent)
            return np.array([half[0], half[1], 0.0]), np.full(3, 1e-9)
        case _GEOM.mjGEOM_CYLINDER | _GEOM.mjGEOM_BOX:
            bevel = _BEVEL * half.min()
            return half - bevel, np.full(3, bevel)
        case _:
            return np.zeros(3), np.ones(3)
