"""The shape of the paper's table 1: steps a second over resolution and polygon count."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ripple_sim.solver import Material, Mesh, build_atlas
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.layouts.build import atlas_from_sphere_map
from ripple_sim.solver.operator.assembly import build_operator

RESOLUTIONS = (20, 28, 40, 56, 128, 256, 512)
POLYGONS = (2_700, 5_700, 10_700, 21_300)

_SECONDS = 0.1


def steps_per_second(
    resolutions: tuple[int, ...] = RESOLUTIONS, polygons: tuple[int, ...] = POLYGONS, backend: str = "cpu"
) -> dict[str, dict[str, float]]:
    """Substeps a second, and seconds for the atlas, by polygon count and resolution."""
    table = {}
    for count in polygons:
        start = time.perf_counter()
        atlas = build_atlas(knobbly_body(count), resolutions[0], cache=False)
        row = {"sphere map [s]": time.perf_counter() - start}
        for n in resolutions:
            start = time.perf_counter()
            texels = atlas_from_sphere_map(atlas.mesh, atlas.sphere, n)
            operator = build_operator(texels, Material(), "fem")
            row[f"atlas {n} [s]"] = time.perf_counter() - start
            solver = make_backend(backend, operator)
            solver.advance(4, 1e-6)
            steps, best = 4, np.inf
            until = time.perf_counter() + _SECONDS
            while time.perf_counter() < until:
                start = time.perf_counter()
                solver.advance(steps, 1e-6)
                solver.wait()
                best = min(best, (time.perf_counter() - start) / steps)
                steps = max(4, min(200, int(_SECONDS / 5 / best)))
            row[f"steps/s {n}"] = 1 / best
        table[str(count)] = row
    return table


def knobbly_body(polygons: int) -> Mesh:
    """A body with knobs and exactly this (even) number of triangles."""
    points = _spiral(polygons // 2 + 2)
    radius = 1 + 0.25 * np.sin(4 * points[:, :1]) * np.sin(3 * points[:, 1:2] + 1) * np.sin(4 * points[:, 2:] + 2)
    return Mesh.from_arrays(points * radius, ConvexHull(points).simplices, name="knobbly body")


def _spiral(count: int) -> NDArray[np.float64]:
    """Points spread evenly on the unit sphere (the golden spiral)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
