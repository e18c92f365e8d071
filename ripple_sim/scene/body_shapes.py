"""Shapes of falling bodies, by name: MuJoCo's primitives of 0.6 to 1 times the volume of a ball."""

from __future__ import annotations

import mujoco

_GEOM = mujoco.mjtGeom

# type, half-sizes over the body's radius
BODY_SHAPES = {
    "sphere": (_GEOM.mjGEOM_SPHERE, (1.0, 0.0, 0.0)),
    "box": (_GEOM.mjGEOM_BOX, (0.8, 0.8, 0.8)),
    "capsule": (_GEOM.mjGEOM_CAPSULE, (0.65, 0.85, 0.0)),
    "ellipsoid": (_GEOM.mjGEOM_ELLIPSOID, (1.2, 0.9, 0.7)),
    "cylinder": (_GEOM.mjGEOM_CYLINDER, (0.9, 0.5, 0.0)),
}
