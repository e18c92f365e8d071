"""Where the bumps of the measurements of arrival are let go."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver import Atlas


def spread_sources(atlas: Atlas, count: int) -> list[int]:
    """Vertices spread evenly over the atlas, the same for every call.

    In the cube layout they are nearest to a spiral on the sphere; in another they follow one another at equal shares of
    the area, chart by chart, on the largest part of the mesh.
    """
    if atlas.layout != "cube":
        return _sources_by_area(atlas, count)
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    spiral = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    return [int(vertex) for vertex in np.argmax(spiral @ atlas.sphere.T, axis=1)]


def _sources_by_area(atlas: Atlas, count: int) -> list[int]:
    mesh, triangles = atlas.mesh, atlas.triangles.ravel()
    part = mesh.components[triangles]
    texels = np.flatnonzero(part == np.argmax(np.bincount(part, atlas.areas.ravel())))
    share = np.cumsum(atlas.areas.ravel()[texels])
    chosen = texels[np.searchsorted(share, (np.arange(count) + 0.5) / count * share[-1])]
    corner = np.argmax(atlas.barycentrics.reshape(-1, 3)[chosen], axis=1)
    return [int(vertex) for vertex in mesh.F[triangles[chosen], corner]]
