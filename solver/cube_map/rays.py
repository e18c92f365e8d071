"""Rays from the cube's centre through every texel onto the sphere-mapped mesh: triangle and barycentrics of each."""

from __future__ import annotations

import igl
import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray

from ripple_sim.solver.errors import AtlasError
from ripple_sim.solver.kernel import Floats, Ints, kernel


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
def _edge_products(sphere: Floats, corners: Ints, d: Floats, out: Floats) -> float:
    """Triple products det(d, b, c) of the ray with the three edges: all >= 0 if and only if it passes inside."""
    for k in range(3):
        b, c = sphere[corners[(k + 1) % 3]], sphere[corners[(k + 2) % 3]]
        out[k] = (
            d[0] * (b[1] * c[2] - b[2] * c[1]) + d[1] * (b[2] * c[0] - b[0] * c[2]) + d[2] * (b[0] * c[1] - b[1] * c[0])
        )
    return min(out[0], out[1], out[2])


@kernel
def _settle(sphere: Floats, F: Ints, neighbours: Ints, directions: Floats, hits: Ints, barycentrics: Floats) -> int:
    """Walk each ray's hit to the triangle that truly contains it; fill barycentrics; return how many rays are lost."""
    product = np.empty(3)
    lost = 0
    previous = 0
    for i in range(len(directions)):
        d = directions[i]
        triangle = hits[i] if hits[i] >= 0 else previous
        inside = False
        for _ in range(200):
            inside = _edge_products(sphere, F[triangle], d, product) >= 0
            if inside:
                break
            worst = 0
            for k in range(1, 3):
                if product[k] < product[worst]:
                    worst = k
            # libigl numbers the edge (corner k, corner k + 1) as k; the edge opposite corner k is (k + 1, k + 2)
            triangle = neighbours[triangle, (worst + 1) % 3]
        if not inside or product.sum() <= 0:
            # a walk can circle on very distorted maps: look at every triangle
            best = -np.inf
            for f in range(len(F)):
                score = _edge_products(sphere, F[f], d, product)
                if score > best and product.sum() > 0:
                    best, triangle = score, f
            _edge_products(sphere, F[triangle], d, product)
            if best < -1e-12:
                lost += 1
        total = 0.0
        for k in range(3):
            product[k] = max(product[k], 0.0)
            total += product[k]
        for k in range(3):
            barycentrics[i, k] = product[k] / total
        hits[i] = triangle
        previous = triangle
    return lost
