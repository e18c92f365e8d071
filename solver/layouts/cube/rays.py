"""Rays from the cube's centre through every texel onto the sphere-mapped mesh: triangle and barycentrics of each."""

from __future__ import annotations

import igl
import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray

from ...errors import AtlasError
from ...kernel import Floats, Ints, kernel


def cast_rays(
    sphere: NDArray[np.float64], F: NDArray[np.int64], directions: NDArray[np.float64], stride: int = 1
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Intersect rays from the origin with the sphere-mapped mesh.

    Embree finds triangles in float32; the barycentrics are computed again in float64, which also moves a hit to the
    neighbouring triangle where float32 chose wrongly and recovers rays that slipped between two triangles.

    Parameters
    ----------
    sphere : [vertex_count, 3]
        A fold-free sphere map (unit vectors).
    F : [triangle_count, 3]
    directions : [k, 3]
        Ray directions.
    stride : int
        Embree casts only one ray of so many. Those after it, which should be close by, walk on from its triangle to
        their own: a texel is mostly in the triangle of the one before it, or next to that.

    Returns
    -------
    triangles : int64 [k]
    barycentrics : float64 [k, 3]
        Not negative, each row sums to 1.

    Raises
    ------
    AtlasError
        If a ray meets no triangle, which a fold-free map rules out.
    """
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, sphere.astype(np.float32), F.astype(np.int32))
    seeds = directions[::stride].astype(np.float32)
    hits = np.full(len(directions), -1, dtype=np.int64)
    hits[::stride] = scene.run(np.zeros_like(seeds), seeds, output=1)["primID"]
    neighbours, _ = igl.triangle_triangle_adjacency(F)
    barycentrics = np.empty((len(directions), 3))
    lost = _settle(sphere, F, neighbours.astype(np.int64), directions, hits, barycentrics)
    if lost:
        raise AtlasError(f"{lost} of {len(directions)} rays meet no triangle of the sphere map; is the map fold-free?")
    return hits, barycentrics


@kernel
def _edge_products(sphere: Floats, corners: Ints, d: Floats) -> tuple[float, float, float]:
    """Triple products det(d, b, c) of the ray with the three edges: all >= 0 if and only if it passes inside."""
    a, b, c = sphere[corners[0]], sphere[corners[1]], sphere[corners[2]]
    return _triple_product(d, b, c), _triple_product(d, c, a), _triple_product(d, a, b)


@kernel
def _triple_product(a: Floats, b: Floats, c: Floats) -> float:
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])


@kernel
def _settle(sphere: Floats, F: Ints, neighbours: Ints, directions: Floats, hits: Ints, barycentrics: Floats) -> int:
    """Walk each ray's hit to the triangle that truly contains it; fill barycentrics; return how many rays are lost."""
    lost = 0
    previous = 0
    for i in range(len(directions)):
        d = directions[i]
        triangle = hits[i] if hits[i] >= 0 else previous
        x, y, z = _edge_products(sphere, F[triangle], d)
        for _ in range(200):
            if min(x, y, z) >= 0:
                break
            worst = 2 if z < min(x, y) else 1 if y < x else 0
            # libigl numbers the edge (corner k, corner k + 1) as k; the edge opposite corner k is (k + 1, k + 2)
            triangle = neighbours[triangle, (worst + 1) % 3]
            x, y, z = _edge_products(sphere, F[triangle], d)
        if min(x, y, z) < 0 or x + y + z <= 0:
            # a walk can circle on very distorted maps: look at every triangle
            best = -np.inf
            for f in range(len(F)):
                x, y, z = _edge_products(sphere, F[f], d)
                if min(x, y, z) > best and x + y + z > 0:
                    best, triangle = min(x, y, z), f
            x, y, z = _edge_products(sphere, F[triangle], d)
            if best < -1e-12:
                lost += 1
        x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
        total = x + y + z
        barycentrics[i, 0], barycentrics[i, 1], barycentrics[i, 2] = x / total, y / total, z / total
        hits[i] = triangle
        previous = triangle
    return lost
