"""Ambient occlusion and thickness of a mesh, found with rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ripple_sim.solver.mesh.topology import edges_of

from .corners import normalized

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
    return cast(V, F, frames_about(normals), count, bounding_radius(V))


def bounding_radius(V: NDArray) -> float:
    """Of vertices [n, 3], about their mean [m]."""
    return float(np.linalg.norm(V - V.mean(axis=0), axis=1).max())


def cast(V: NDArray, F: NDArray, frames: NDArray, count: int, radius: float, start: float = 0.0) -> Baked:
    """Cast rays from every vertex to either side.

    Parameters
    ----------
    V, F : [n, 3], [m, 3]
    frames : [n, 3, 3]
        Tangent, bitangent and normal of every vertex as rows, about which the rays are spread.
    count : int
        Rays to each side of a vertex.
    radius : float
        Length that thickness is told in; walls further away than that hide no light [m].
    start : float
        Walls nearer than that are not seen [m].
    """
    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(V, np.float32), np.ascontiguousarray(F, np.int32))

    def distances(side: float) -> NDArray[np.float64]:
        directions = side * _hemisphere(frames, count)
        origins = (V + side * 1e-3 * radius * frames[:, 2])[:, None] + start * directions
        rays = (each.reshape(-1, 3).astype(np.float32) for each in (origins, directions))
        hits = start + scene.run(*rays, query="DISTANCE")
        return np.minimum(hits / radius, 4.0).reshape(len(V), count)

    # nearby walls hide the light, those further than a radius away reflect some themselves
    outer, inner = distances(1.0), distances(-1.0)
    values, (edges, _) = (np.minimum(outer, 1.0), inner, np.minimum(inner, 1.0)), edges_of(F)
    return Baked(*(_smoothed(each.mean(axis=1), edges) for each in values))


def frames_about(normals: NDArray, along: NDArray | None = None) -> NDArray[np.float64]:
    """Tangent, bitangent and normal as rows [n, 3, 3]; the bitangent is as near as may be to a direction, [n, 3]."""
    if along is None:
        along = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = normalized(np.cross(along, normals))  # a vertex without triangles has no normal
    return np.stack([tangent, np.cross(normals, tangent), normals], axis=1)


def _hemisphere(frames: NDArray, count: int) -> NDArray[np.float64]:
    """Cosine-distributed directions on a spiral about every normal, turned differently at every vertex."""
    index = np.arange(count) + 0.5
    golden = np.pi * (3 - np.sqrt(5))
    turn = index * golden + (np.arange(len(frames)) * golden)[:, None]
    r, z = np.sqrt(index / count), np.sqrt(1 - index / count)
    local = np.stack([r * np.cos(turn), r * np.sin(turn), np.broadcast_to(z, turn.shape)], axis=2)
    return local @ frames


def _smoothed(values: NDArray, edges: NDArray, rounds: int = 2) -> NDArray[np.float64]:
    """Average over neighbours along edges [k, 2], against the noise of few rays."""
    both = np.concatenate([edges, edges[:, ::-1]])
    degree = np.bincount(both[:, 0], minlength=len(values))
    for _ in range(rounds):
        mean = np.bincount(both[:, 0], weights=values[both[:, 1]], minlength=len(values)) / np.maximum(degree, 1)
        values = (values + mean) / 2
    return values
