"""Stiffness weights and areas against assembly by brute force."""

import numpy as np

from ripple_sim.solver.layouts.cube.convention import cube_topology, texel_directions
from ripple_sim.solver.texels.texel_mesh import TexelMesh


def element(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Stiffness matrix and area of a cell with 3 or 4 corners [k, 3], in order round it."""
    if len(corners) == 4:
        frame = np.array([corners[2] - corners[0], corners[3] - corners[1]])
        differences = np.array([[-1.0, 0, 1, 0], [0, -1, 0, 1]])
        area = np.linalg.norm(np.cross(*frame)) / 2
    else:
        frame = corners[1:] - corners[0]
        differences = np.array([[-1.0, 1, 0], [-1, 0, 1]])
        area = np.linalg.norm(np.cross(*frame)) / 2
    # the gradient in space whose components along the frame are the differences
    gradient = np.linalg.pinv(frame) @ differences
    stiffness = area * gradient.T @ gradient
    if len(corners) == 4:
        hourglass = np.array([1.0, -1, 1, -1])
        # where the quad is uneven, linear functions have next to nothing of the pattern
        unevenness = np.linalg.lstsq(frame.T, hourglass @ corners, rcond=None)[0]
        share = unevenness @ unevenness / (unevenness @ unevenness + 1e-3)
        hourglass -= share * (hourglass @ corners @ gradient)
        stiffness += hourglass_stiffness(frame, area) * np.outer(hourglass, hourglass)
        triangles = corners[[[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]]
        edges = triangles[:, 1:] - triangles[:, :1]
        twice = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        area = min(twice[:2].sum(), twice[2:].sum()) / 2
    return stiffness, area


def hourglass_stiffness(diagonals: np.ndarray, area: float) -> float:
    """What waves in time ask for, but no more than a share of what the time step allows, or a square's."""
    first, second = (diagonals[0] - diagonals[1]) / 2, (diagonals[0] + diagonals[1]) / 2
    long, both = max(first @ first, second @ second), first @ first + second @ second
    in_time = both * area / 2 / (area**2 + 3 * (first @ second) ** 2)
    free = (long**2 - (first @ second) ** 2) / (4 * long * area)
    return min(in_time, max(0.75 * free, 0.4 * 2 * area / both))


def brute_force_laplacian(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix and lumped areas, cell by cell."""
    n = positions.shape[1]
    x = positions.reshape(-1, 3)
    index = cube_topology(n).halo
    cells = {}
    for face in range(6):
        for r in range(n + 1):
            for c in range(n + 1):
                ring = [index[face, r, c], index[face, r, c + 1], index[face, r + 1, c + 1], index[face, r + 1, c]]
                ring = [i for i in ring if i >= 0]
                cells[frozenset(ring)] = ring
    stiffness = np.zeros((len(x), len(x)))
    areas = np.zeros(len(x))
    for ring in cells.values():
        part, area = element(x[ring])
        stiffness[np.ix_(ring, ring)] -= part
        areas[ring] += area / len(ring)
    return stiffness, areas


def test_stencil_equals_brute_force_assembly(bumpy: TexelMesh) -> None:
    stiffness, areas = brute_force_laplacian(bumpy.positions)
    h = np.random.default_rng(0).standard_normal((6, 6, 6))
    stencil = bumpy.stencil(np.ones((6, 6, 6)))
    np.testing.assert_allclose(stencil(h).ravel(), stiffness @ h.ravel(), atol=1e-12)
    np.testing.assert_allclose(bumpy.stiffness().toarray(), -stiffness, atol=1e-12)
    np.testing.assert_allclose(bumpy.areas.ravel(), areas, rtol=1e-12)


def test_sphere_area_converges_at_second_order() -> None:
    error = [4 * np.pi - TexelMesh.of(cube_topology(n), texel_directions(n)).areas.sum() for n in (8, 16, 32, 64)]
    orders = np.log2(np.array(error[:-1]) / error[1:])
    assert (orders > 1.95).all()


def test_softened_cells_are_as_stiff_as_their_softest_corner(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    even = np.ones((6, n, n))
    factors = even.copy()
    factors[0, 2, 3] = 0.25
    stiff, soft = bumpy.stencil(even), bumpy.stencil(even, factors)
    h = np.zeros((6, n, n))
    h[0, 2, 3] = 1.0
    np.testing.assert_allclose(soft(h)[0, 2, 3], 0.25 * stiff(h)[0, 2, 3])
    h = np.random.default_rng(2).standard_normal((6, n, n))
    changed = soft(h) != stiff(h)
    assert changed[0, 1:4, 2:5].all()
    assert changed.sum() == 9
