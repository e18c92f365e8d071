"""The shipped target meshes, each a closed surface of genus 0 modelled with smoothly blended implicit solids.

`python -m ripple_sim.scenes.shapes` writes `meshes/duck.obj` and `meshes/limbed.obj` again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.files import atomic_write

from .implicit import (
    Array,
    Sdf,
    capsule,
    ellipsoid,
    half_space,
    mirrored,
    pebble,
    polygonise,
    rounded_cone,
    smooth_intersection,
    smooth_union,
    sphere,
)

__all__ = ["DUCK_FILE", "LIMBED_FILE", "duck", "limbed", "peanut", "polygonise", "write_obj"]

DUCK_FILE = Path(__file__).parent / "meshes" / "duck.obj"
LIMBED_FILE = DUCK_FILE.with_name("limbed.obj")

Triangles = NDArray[np.int64]


def duck(cell: float = 0.0235) -> tuple[Array, Triangles]:
    """Model a bath duck about 1 m long that faces +x and stands on z = 0, mirrored in y = 0 up to the triangulation.

    Parameters
    ----------
    cell : float
        Edge of the triangles, roughly [m].

    Returns
    -------
    V, F
        Vertices [n, 3] float64 [m] and triangles [m, 3] int64, oriented outwards.
    """
    V, F = polygonise(_duck_solid(), ((-0.6, -0.45, -0.03), (0.6, 0.45, 0.95)), cell)
    return V - [0.0, 0.0, V[:, 2].min()], F


def limbed(cell: float = 0.02) -> tuple[Array, Triangles]:
    """Model a plump animal on four legs, 0.7 m long, standing on z = 0: concave between the legs and under the chin."""
    legs = [capsule((x, y, 0.22), (1.25 * x, 1.4 * y, 0.05), 0.05) for x in (-0.17, 0.17) for y in (-0.09, 0.09)]
    trunk = ellipsoid((0.0, 0.0, 0.3), (0.27, 0.15, 0.14))
    neck = rounded_cone((0.18, 0.0, 0.34), (0.3, 0.0, 0.5), 0.08, 0.06)
    head = ellipsoid((0.33, 0.0, 0.52), (0.12, 0.085, 0.085))
    solid = smooth_union(0.05, trunk, *legs, neck, head)
    V, F = polygonise(solid, ((-0.35, -0.25, -0.06), (0.52, 0.25, 0.7)), cell)
    return V - [0.0, 0.0, V[:, 2].min()], F


def peanut(cell: float = 0.02) -> tuple[Array, Triangles]:
    """Model two blended balls along x, 0.7 m long, about the origin: smooth, with a saddle all round its waist."""
    solid = smooth_union(0.12, sphere((-0.17, 0.0, 0.0), 0.18), sphere((0.17, 0.0, 0.0), 0.18))
    return polygonise(solid, ((-0.4, -0.25, -0.25), (0.4, 0.25, 0.25)), cell)


def _duck_solid() -> Sdf:
    torso = smooth_union(
        0.12,
        ellipsoid((-0.06, 0.0, 0.24), (0.39, 0.31, 0.25)),
        sphere((0.14, 0.0, 0.26), 0.26),  # the breast
        rounded_cone((-0.27, 0.0, 0.29), (-0.46, 0.0, 0.50), 0.17, 0.05),  # the tail
    )
    wing = smooth_union(
        0.10,
        ellipsoid((-0.05, 0.285, 0.30), (0.17, 0.065, 0.115), _turned(pitch=0.15, yaw=0.12)),
        rounded_cone((-0.14, 0.30, 0.32), (-0.27, 0.29, 0.41), 0.065, 0.035),
    )
    torso = smooth_union(0.04, torso, mirrored(wing))
    neck = rounded_cone((0.14, 0.0, 0.40), (0.19, 0.0, 0.58), 0.18, 0.16)
    head = sphere((0.19, 0.0, 0.68), 0.222)
    bill = smooth_union(
        0.025,
        pebble((0.415, 0.0, 0.663), 0.085, 0.034, _turned(pitch=-0.20)),
        pebble((0.40, 0.0, 0.605), 0.060, 0.030, _turned(pitch=0.12)),
    )
    eye = sphere((0.325, 0.118, 0.755), 0.052)
    solid = smooth_union(0.08, torso, smooth_union(0.05, neck, head))
    solid = smooth_union(0.035, solid, bill)
    solid = smooth_union(0.02, solid, mirrored(eye))
    return smooth_intersection(0.04, solid, half_space((0.0, 0.0, -1.0), -0.035))


def _turned(pitch: float = 0.0, yaw: float = 0.0) -> Array:
    """Rotation by `pitch` about y (positive noses down), then by `yaw` about z [rad]."""
    cp, sp, cy, sy = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])


def write_obj(path: Path, V: Array, F: Triangles) -> None:
    """Write vertices to five significant decimals and triangles as a Wavefront file, all of it or nothing."""
    lines = ["# made by python -m ripple_sim.scenes.shapes"]
    lines += [f"v {x:.5g} {y:.5g} {z:.5g}" for x, y, z in V]
    lines += [f"f {a} {b} {c}" for a, b, c in F + 1]
    with atomic_write(path) as unfinished:
        unfinished.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    write_obj(DUCK_FILE, *duck())
    write_obj(LIMBED_FILE, *limbed())
