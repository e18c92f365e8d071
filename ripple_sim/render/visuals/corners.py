"""Vertices of meshes for drawing: normals, splits where they jump, occlusion and thickness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.mesh.queries import RayScene
from ripple_sim.solver.mesh.topology import (
    edges_of,
    labels,
    normalized,
    triangle_normals,
    undirected,
)

# Angle between the normal of a triangle and the normal that it shares at a vertex above which the
# triangle keeps its own [degrees].
_MAX_NORMAL_ANGLE = 60.0

_RAYS = 1_000_000  # for a mesh, about, on both sides of its surface


def split_corners(
    V: NDArray,
    F: NDArray,
    corner_uv: NDArray | None = None,
    coordinates: NDArray | None = None,
    normals: NDArray | None = None,
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
]:
    """Split vertices where normals, texture coordinates or other coordinates jump.

    Parameters
    ----------
    corner_uv : array, shape [m, 3, 2], optional
        Texture coordinates.
    coordinates : array, shape [m, 3, d], optional
    normals : array, shape [m, 3, 3], optional
        By default the ones of `corner_normals`.

    Returns
    -------
    vertices : int64 [n]
        Number that each vertex had before.
    faces : int64 [m, 3]
    normals, uv, coordinates : float64 [n, 3], [n, 2], [n, d]
    """
    normals = corner_normals(V, F) if normals is None else normals
    uv = np.zeros((*F.shape, 2)) if corner_uv is None else corner_uv
    others = np.zeros((*F.shape, 0)) if coordinates is None else coordinates
    corners = np.concatenate([F[:, :, None], normals, uv, others], axis=2)
    unique, index = np.unique(corners.reshape(F.size, -1), axis=0, return_inverse=True)
    return (
        unique[:, 0].astype(np.int64),
        index.reshape(F.shape),
        unique[:, 1:4],
        unique[:, 4:6],
        unique[:, 6:],
    )


def smooth_normals(V: NDArray, F: NDArray) -> NDArray[np.float64]:
    """One normal a vertex, shape [n, 3]; zero where a vertex has no triangle."""
    return _sums(_weighted(V, F), F.ravel(), len(V))


def corner_normals(V: NDArray, F: NDArray, crease: float = 45.0) -> NDArray[np.float64]:
    """Angle-weighted unit normals of every triangle's corners, shape [m, 3, 3].

    The triangles round a vertex share one normal from crease to crease, edges that bend by more
    than `crease` degrees: sharp edges stay sharp and run out smoothly where they end. A triangle
    that is turned far away from that normal, as at the tip of a cone, keeps its own.
    """
    own = np.repeat(triangle_normals(V, F), 3, axis=0)
    fan = _fans(F, own[::3], crease)
    shared = _sums(_weighted(V, F), fan, len(fan))[fan]
    cosine = np.einsum("ij,ij->i", shared, own)
    is_astray = (cosine < np.cos(np.radians(_MAX_NORMAL_ANGLE))) & own.any(axis=1)
    return np.where(is_astray[:, None], own, shared).reshape(len(F), 3, 3)


def _fans(F: NDArray, triangle: NDArray[np.float64], crease: float) -> NDArray[np.int64]:
    """Numbers of the corners [3 m], equal where their triangles are connected round a vertex.

    Triangles are not connected across a crease; `triangle` [m, 3] are their normals.
    """
    ends = np.stack([F, np.roll(F, -1, axis=1)], axis=2).reshape(-1, 2)
    number = np.arange(F.size).reshape(F.shape)
    corners = np.stack([number, np.roll(number, -1, axis=1)], axis=2).reshape(-1, 2)
    corners = np.take_along_axis(corners, ends.argsort(axis=1), axis=1)
    _, edge, count = np.unique(undirected(F)[0], return_inverse=True, return_counts=True)
    order = np.argsort(edge, kind="stable")
    one, other = order[count[edge[order]] == 2].reshape(-1, 2).T
    a = triangle[one // 3]
    b = triangle[other // 3]
    # a triangle without area bends nowhere
    cosine = np.einsum("ij,ij->i", a, b)
    is_smooth = (cosine >= np.cos(np.radians(crease)) - 1e-9) | ~a.any(axis=1) | ~b.any(axis=1)
    pairs = np.stack([corners[one[is_smooth]], corners[other[is_smooth]]], axis=1)
    pairs = pairs.reshape(-1, 2, 2)
    return labels(pairs.swapaxes(1, 2).reshape(-1, 2), F.size)


def _weighted(V: NDArray, F: NDArray) -> NDArray[np.float64]:
    """Normals of the triangles, weighted with their angles at the corners [3 m, 3]."""
    sides = normalized(V[np.roll(F, -1, axis=1)] - V[F])
    angles = np.arccos(
        np.clip(np.einsum("fkj,fkj->fk", sides, -np.roll(sides, 1, axis=1)), -1.0, 1.0)
    )
    return (angles[:, :, None] * triangle_normals(V, F)[:, None, :]).reshape(-1, 3)


def _sums(weighted: NDArray[np.float64], group: NDArray, count: int) -> NDArray[np.float64]:
    """Unit sums of vectors [k, 3] that belong to the same of `count` groups [k]."""
    return normalized(
        np.stack([np.bincount(group, column, count) for column in weighted.T], axis=1)
    )


def bake(V: NDArray, F: NDArray, normals: NDArray) -> NDArray[np.float64]:
    """Ambient occlusion and thickness, by rays from every vertex outwards and inwards.

    The rays are cosine-distributed.

    Returns
    -------
    float64 [n, 3]
        Ambient visibility, 1 - occlusion: share of the outer hemisphere from which light arrives.
        Thickness: mean length of the inner rays over the mesh's bounding radius. Ambient visibility
        of the inner side, which an open surface shows.
    """
    count = int(np.clip(_RAYS // (2 * len(V)), 16, 64))
    return cast(V, F, frames_about(normals), count, bounding_radius(V))


def bounding_radius(V: NDArray) -> float:
    """Radius of the ball about the mean of vertices [n, 3] that holds them [m]."""
    return float(np.linalg.norm(V - V.mean(axis=0), axis=1).max())


def cast(
    V: NDArray, F: NDArray, frames: NDArray, count: int, radius: float, start: float = 0.0
) -> NDArray[np.float64]:
    """Cast rays from every vertex to either side, as `bake` does.

    Parameters
    ----------
    V, F : [n, 3], [m, 3]
    frames : [n, 3, 3]
        Tangent, bitangent and normal of every vertex as rows, about which the rays are spread.
    count : int
        Rays to each side of a vertex.
    radius : float
        Unit of the thickness; walls further away than this length hide no light [m].
    start : float
        Walls nearer than this length are not seen [m].
    """
    scene = RayScene(V, F)
    # cosine-distributed directions on a spiral about every normal, turned differently at every
    # vertex
    index = np.arange(count) + 0.5
    golden = np.pi * (3 - np.sqrt(5))
    turn = index * golden + (np.arange(len(frames)) * golden)[:, None]
    r = np.sqrt(index / count)
    z = np.sqrt(1 - index / count)
    hemisphere = (
        np.stack([r * np.cos(turn), r * np.sin(turn), np.broadcast_to(z, turn.shape)], axis=2)
        @ frames
    )

    def distances(side: float) -> NDArray[np.float64]:
        directions = side * hemisphere
        origins = (V + side * 1e-3 * radius * frames[:, 2])[:, None] + start * directions
        hits = start + scene.distances(origins.reshape(-1, 3), directions.reshape(-1, 3))
        return (np.minimum(hits, 4.0 * radius) / radius).reshape(len(V), count)

    # nearby walls hide the light, those further than a radius away reflect some themselves
    outer = distances(1.0)
    inner = distances(-1.0)
    visibility = np.minimum(outer, 1.0).mean(axis=1)
    thickness = inner.mean(axis=1)
    inner_visibility = np.minimum(inner, 1.0).mean(axis=1)
    means = np.stack([visibility, thickness, inner_visibility], axis=1)
    ends = edges_of(F).ends
    here, there = np.concatenate([ends, ends[:, ::-1]]).T
    degree = np.maximum(np.bincount(here, minlength=len(V)), 1)[:, None]
    for _ in range(2):  # over neighbours, against the noise of few rays
        sums = [np.bincount(here, weights=column[there], minlength=len(V)) for column in means.T]
        means = (means + np.stack(sums, axis=1) / degree) / 2
    return means


def frames_about(normals: NDArray, along: NDArray | None = None) -> NDArray[np.float64]:
    """Tangent, bitangent and normal as rows [n, 3, 3].

    The bitangent is as near as possible to the direction `along` [n, 3].
    """
    if along is None:
        along = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    tangent = normalized(np.cross(along, normals))  # a vertex without triangles has no normal
    return np.stack([tangent, np.cross(normals, tangent), normals], axis=1)
