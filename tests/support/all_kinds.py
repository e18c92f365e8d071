"""Surfaces of every kind: handles, holes, twists, many parts, few triangles."""

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]

BALL = trimesh.creation.icosphere(subdivisions=1)


def cube() -> Arrays:
    box = trimesh.creation.box()
    return np.array(box.vertices), np.array(box.faces)


def torus() -> Arrays:
    solid = trimesh.creation.torus(1.0, 0.3)
    return np.array(solid.vertices), np.array(solid.faces)


def thickened_graph(genus: int, seed: int, radius: float = 0.28, spacing: float = 0.13) -> Arrays:
    """Tubes along a random connected graph; its independent cycles are the handles."""
    ends = graph(genus, np.random.default_rng(seed))
    low = ends.min(axis=(0, 1)) - 0.5
    high = ends.max(axis=(0, 1)) + 0.5
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    P = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    distance = np.full(len(P), np.inf)
    for a, b in ends:
        share = np.clip((P - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distance = np.minimum(
            distance, np.linalg.norm(P - a - share[:, None] * (b - a), axis=1) - radius
        )
    # not on a node, where triangles would have no area
    distance = np.where(np.abs(distance) < 0.01 * spacing, 0.01 * spacing, distance)
    V, F, _ = igl.marching_cubes(distance, P, *map(len, axes), 0.0)
    return V, F


def graph(genus: int, rng: np.random.Generator, size: int = 3) -> NDArray[np.float64]:
    """Segments [k, 2, 3] of a tree on a cubic lattice, and one more for each cycle."""
    nodes = [(x, y, z) for x in range(size) for y in range(size) for z in range(size)]
    links = [
        (a, b)
        for a in nodes
        for b in nodes
        if a < b and sum(abs(p - q) for p, q in zip(a, b, strict=True)) == 1
    ]
    links = [links[k] for k in rng.permutation(len(links))]
    reached = {nodes[0]}
    edges = []
    count = min(len(nodes), 15)
    while len(reached) < count:
        edges.append(next(link for link in links if len(reached & set(link)) == 1))
        reached |= set(edges[-1])
    edges += [link for link in links if reached.issuperset(link) and link not in edges][:genus]
    assert len(edges) == count - 1 + genus
    return np.array(edges, dtype=float)


def punctured_ball(seed: int, holes: int, subdivisions: int = 3) -> Arrays:
    """A ball without the triangles round some vertices that are not near each other."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    V = np.array(ball.vertices)
    F = np.array(ball.faces)
    rng = np.random.default_rng(seed)
    chosen: list[int] = []
    for vertex in rng.permutation(len(V)):
        if len(chosen) < holes and all(
            np.linalg.norm(V[vertex] - V[other]) > 0.6 for other in chosen
        ):
            chosen.append(int(vertex))
    assert len(chosen) == holes
    return V, F[~np.isin(F, chosen).any(axis=1)]


def band(half_twists: int, length: int = 40, width: int = 4) -> Arrays:
    """A closed strip; with an odd number of half twists a Moebius band."""
    u, v = np.meshgrid(np.arange(length), np.arange(width + 1), indexing="ij")
    angle = 2 * np.pi * u / length
    across = v / width - 0.5
    twist = half_twists * angle / 2
    radius = 2 + across * np.cos(twist)
    V = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), across * np.sin(twist)], axis=-1
    ).reshape(-1, 3)

    def number(u: NDArray, v: NDArray) -> NDArray:
        return np.where(u < length, u * (width + 1) + v, width - v if half_twists % 2 else v)

    return V, _grid(number, length, width)


def klein_bottle(length: int = 24, width: int = 12) -> Arrays:
    """The figure-eight immersion: closed, one-sided, and passing through itself along a circle."""
    u, v = np.meshgrid(np.arange(length), np.arange(width), indexing="ij")
    a = 2 * np.pi * u / length
    b = 2 * np.pi * (v + 0.5) / width
    radius = 2 + np.cos(a / 2) * np.sin(b) - np.sin(a / 2) * np.sin(2 * b)
    height = np.sin(a / 2) * np.sin(b) + np.cos(a / 2) * np.sin(2 * b)
    V = np.stack([radius * np.cos(a), radius * np.sin(a), height], axis=-1).reshape(-1, 3)

    def number(u: NDArray, v: NDArray) -> NDArray:
        # once round, the eight is turned half way: b becomes -b
        return np.where(u < length, u * width + v % width, (width - 1 - v) % width)

    return V, _grid(number, length, width)


def _grid(number, length: int, width: int) -> NDArray[np.int64]:
    u, v = (x.ravel() for x in np.meshgrid(np.arange(length), np.arange(width), indexing="ij"))
    a = number(u, v)
    b = number(u + 1, v)
    c = number(u + 1, v + 1)
    d = number(u, v + 1)
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def crumbs(count: int, seed: int = 0) -> Arrays:
    """Tetrahedra and pairs of triangles, scattered."""
    rng = np.random.default_rng(seed)
    V = rng.uniform(size=(count, 4, 3)) + 3 * np.arange(count)[:, None, None] * [1, 0, 0]
    closed = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
    sheet = [[0, 1, 2], [0, 2, 3]]
    F = [np.array(closed if k % 2 else sheet) + 4 * k for k in range(count)]
    return V.reshape(-1, 3), np.concatenate(F)


def needles(count: int, thickness: float = 1e-6) -> Arrays:
    """A fan of triangles that are hardly wider than round-off."""
    angle = np.arange(count + 1) * thickness
    return np.vstack(
        [[[0, 0, 0]], np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)]
    ), np.stack(
        [np.zeros(count, dtype=int), np.arange(1, count + 1), np.arange(2, count + 2)], axis=1
    )


def voxels(filled: NDArray[np.bool_]) -> Arrays:
    """Triangles between filled and empty cells, each with vertices of its own."""
    room = np.pad(filled, 1)
    squares = []
    for axis in range(3):
        for ahead in (0, 1):
            cells = np.argwhere(room & ~np.roll(room, -1 if ahead else 1, axis=axis))
            turn = [(0, 0), (1, 0), (1, 1), (0, 1)][:: 1 if ahead else -1]
            step = np.zeros((4, 3))
            step[:, axis] = ahead
            step[:, [(axis + 1) % 3, (axis + 2) % 3]] = turn
            squares.append(cells[:, None] + step)
    V = np.concatenate(squares)
    first = 4 * np.arange(len(V))[:, None]
    return V.reshape(-1, 3), np.concatenate(
        [first + np.array(corners) for corners in ([0, 1, 2], [0, 2, 3])]
    )


def shuffled(V: NDArray, F: NDArray, seed: int, turned: float = 0.0, loose: bool = False) -> Arrays:
    """The same triangles in another order, a share of them flipped; `loose` splits vertices."""
    rng = np.random.default_rng(seed)
    F = F[rng.permutation(len(F))]
    F = np.where(rng.random(len(F))[:, None] < turned, F[:, ::-1], F)
    if loose:
        return V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3)
    number = rng.permutation(len(V))
    return V[np.argsort(number)], number[F]
