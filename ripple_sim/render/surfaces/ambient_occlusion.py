"""Ambient occlusion and thickness of a mesh, baked once with rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ripple_sim.solver.mesh.topology import edges_of

_RAYS = 1_000_000


class Baked(NamedTuple):
    """What rays from every vertex found, each float64 [n].

    Attributes
    ----------
    visibility : float64 [n]
        Ambient visibility, 1 - occlusion: share of the outer hemisphere from which light arrives.
    thickness : float64 [n]
        Mean length of the inner rays over the mesh's bounding radius.
    inner_visibility : float64 [n]
        Ambient visibility of the inner side, which an open surface shows.
    """

    visibility: NDArray[np.float64]
    thickness: NDArray[np.float64]
    inner_visibility: NDArray[np.float64]


def bake(V: NDArray, F: NDArray, normals: NDArray) -> Baked:
    """Cast cosine-distributed rays from every vertex, outwards and inwards."""
    count = int(np.clip(_RAYS // (2 * len(V)), 16, 64))
    radius = np.linalg.norm(V - V.mean(axis=0), axis=1).max()
    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(V[F], dtype=np.float32))

    def distances(side: float) -> NDArray[np.float64]:
        directions = side * _hemisphere(normals, count)
        origins = np.repeat(V + side * 1e-3 * radius * normals, count, axis=0)
        hits = scene.run(origins.astype(np.float32), directions.reshape(-1, 3).astype(np.float32), query="DISTANCE")
        return np.minimum(hits / radius, 4.0).reshape(len(V), count)

    # nearby walls hide the light, those further than a radius away reflect some themselves
    outer, inner = distances(1.0), distances(-1.0)
    values, (edges, _) = (np.minimum(outer, 1.0), inner, np.minimum(inner, 1.0)), edges_of(F)
    return Baked(*(_smoothed(each.mean(axis=1), edges) for each in values))


def _hemisphere(normals: NDArray, count: int) -> NDArray[np.float64]:
    """Cosine-distributed directions on a spiral about every normal, turned differently at every vertex."""
    index = np.arange(count) + 0.5
    golden = np.pi * (3 - np.sqrt(5))
    turn = index * golden + (np.arange(len(normals)) * golden)[:, None]
    r, z = np.sqrt(index / count), np.sqrt(1 - index / count)
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = np.cross(helper, normals)
    length = np.linalg.norm(tangent, axis=1, keepdims=True)
    tangent /= np.where(length > 0, length, 1.0)  # a vertex without triangles has no normal
    bitangent = np.cross(normals, tangent)
    return (
        (r * np.cos(turn))[..., None] * tangent[:, None]
        + (r * np.sin(turn))[..., None] * bitangent[:, None]
        + z[:, None] * normals[:, None]
    )


def _smoothed(values: NDArray, edges: NDArray, rounds: int = 2) -> NDArray[np.float64]:
    """Average over neighbours along edges [k, 2], against the noise of few rays."""
    both = np.concatenate([edges, edges[:, ::-1]])
    degree = np.bincount(both[:, 0], minlength=len(values))
    for _ in range(rounds):
        mean = np.bincount(both[:, 0], weights=values[both[:, 1]], minlength=len(values)) / np.maximum(degree, 1)
        values = (values + mean) / 2
    return values
