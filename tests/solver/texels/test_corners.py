"""Corners of glued charts: how many charts meet there, which point it is, and the cells that are polygons."""

import numpy as np
import pytest
from hand_made import RIM, flat_charts, flat_torus, polygon, square

from ripple_sim.solver import TexelMesh, TexelTopology, glue
from ripple_sim.solver.layouts.cube.convention import cube_topology

UNIT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
ROWS, COLUMNS = [0, 0, -1, -1], [0, -1, -1, 0]


def random_gluing(charts: int, rims: int, seed: int) -> np.ndarray:
    """Sides in random pairs, but for an even number of rims."""
    rng = np.random.default_rng(seed)
    sides = rng.permutation(4 * charts)
    glued = np.full((4 * charts, 2), -1)
    for a, b in sides[rims:].reshape(-1, 2):
        glued[a], glued[b] = divmod(b, 4), divmod(a, 4)
    return glued.reshape(charts, 4, 2)


def points_by_merging(glued: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of the point in which each corner lies, by merging the ends of glued sides, and whether a rim ends there.

    Side s runs from corner s to corner s + 1, against the side that it is glued to.
    """
    charts = len(glued)
    point = np.arange(4 * charts).reshape(charts, 4)
    at_rim = np.zeros((charts, 4), bool)
    for _ in range(4 * charts):
        for chart, side in np.ndindex(charts, 4):
            other, back = glued[chart, side]
            if other < 0:
                continue
            for a, b in (((chart, side), (other, (back + 1) % 4)), ((chart, (side + 1) % 4), (other, back))):
                point[a] = point[b] = min(point[a], point[b])
    for chart, side in np.argwhere(glued[..., 0] < 0):
        ends = point[chart, side], point[chart, (side + 1) % 4]
        at_rim |= np.isin(point, ends)
    return point, at_rim


def same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    pairs = set(zip(a.ravel().tolist(), b.ravel().tolist(), strict=True))
    return len(pairs) == len(set(a.ravel().tolist())) == len(set(b.ravel().tolist()))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("charts", "rims"), [(1, 0), (1, 2), (2, 0), (3, 4), (5, 0), (6, 10)])
def test_corners_of_any_gluing_are_those_that_merge(charts: int, rims: int, seed: int) -> None:
    glued = random_gluing(charts, rims, seed)
    topology = glue(glued, 3)
    point, at_rim = points_by_merging(glued)
    assert same_partition(topology.corners, point)
    assert topology.corners.min() == 0 and topology.corners.max() == len(np.unique(point)) - 1
    meeting = (point.ravel() == point.ravel()[:, None]).sum(axis=1).reshape(charts, 4)
    np.testing.assert_array_equal(topology.valence, np.where(at_rim, 0, meeting))
    # one polygon for each point that does not fit the stencil
    limit = np.where(at_rim, 2, 4)
    assert len(topology.polygons) == len(np.unique(point[meeting > limit]))
    if rims == 0:
        # Euler: C faces, 2 C edges; each part has at most the characteristic of a sphere, and that of a handle less 2
        assert (topology.corners.max() + 1 - charts) % 2 == 0


def test_the_cube_has_eight_corners_of_three_charts() -> None:
    topology = cube_topology(5)
    assert (topology.valence == 3).all()
    assert np.bincount(topology.corners.ravel()).tolist() == [3] * 8
    assert (topology.halo[:, ROWS, COLUMNS] == -1).all()
    assert topology.polygons == ()


def test_beyond_a_corner_of_four_charts_lies_the_texel_across() -> None:
    topology = flat_torus(4).topology
    index = np.arange(16).reshape(4, 4)
    np.testing.assert_array_equal(topology.halo[0], np.pad(index, 1, mode="wrap"))
    assert (topology.valence == 4).all() and (topology.corners == 0).all()


@pytest.mark.parametrize("sides", [3, 4, 5, 8])
def test_charts_round_a_point_are_a_polygon_from_five_on(sides: int) -> None:
    texels = polygon(sides, 4)
    topology = texels.topology
    assert (topology.valence[:, 0] == sides).all()
    assert len(np.unique(topology.corners[:, 0])) == 1
    assert len(topology.polygons) == (sides > 4)
    for cell in topology.polygons:
        assert cell.tolist() == [16 * chart for chart in range(sides)]


def signed_area(points: np.ndarray) -> float:
    x, y, _ = points.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def l_shape(n: int, turns: tuple[int, int, int]) -> TexelMesh:
    """Three unit squares round an inner corner of the rim; each chart may begin at any of its corners.

    The surface ends at its last texels.
    """
    squares = UNIT + np.array([[[0, 0, 0]], [[1, 0, 0]], [[0, 1, 0]]])
    corners = np.stack([np.roll(square, -turn, axis=0) for square, turn in zip(squares, turns, strict=True)])
    glued = np.full((3, 4, 2), -1)
    for (a, side), (b, back) in (((0, 1), (1, 3)), ((0, 2), (2, 0))):
        mine, other = (side - turns[a]) % 4, (back - turns[b]) % 4
        glued[a, mine], glued[b, other] = (b, other), (a, mine)
    u = (np.arange(n) + 0.5) / n
    s, t = u[None, None, :, None], u[None, :, None, None]
    a, b, c, d = (corners[:, k, None, None] for k in range(4))
    return TexelMesh.of(glue(glued, n), (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d)


@pytest.mark.parametrize("turns", [(0, 0, 0), (1, 2, 3), (3, 0, 2)])
def test_three_charts_at_a_rim_make_a_triangle_wherever_the_charts_begin(turns: tuple[int, int, int]) -> None:
    n = 4
    texels = l_shape(n, turns)
    [cell] = texels.topology.polygons
    points = texels.positions.reshape(-1, 3)[cell]
    # counter-clockwise, the three texels nearest to the inner corner
    assert signed_area(points) == pytest.approx((1 / n) ** 2 / 2)
    np.testing.assert_allclose(np.abs(points - [1, 1, 0])[:, :2], 0.5 / n)
    # all squares of four texels, but for those that touch the missing quarter, and the triangle
    assert texels.areas.sum() == pytest.approx(((2 * n - 1) ** 2 - n**2 + 0.5) / n**2)


def places_beyond_corners(topology: TexelTopology) -> tuple[np.ndarray, np.ndarray]:
    return topology.halo[:, ROWS, COLUMNS], topology.rim[:, ROWS, COLUMNS]


def test_a_lone_chart_repeats_its_corner_texels_beyond_the_rim() -> None:
    halo, rim = places_beyond_corners(square(4).topology)
    assert rim.all()
    assert halo.tolist() == [[0, 3, 15, 12]]


def test_beyond_a_straight_rim_lies_what_the_chart_beside_has_there() -> None:
    glued = [[RIM, (1, 3), RIM, RIM], [RIM, RIM, RIM, (0, 1)]]
    halo, rim = places_beyond_corners(flat_charts([UNIT, UNIT + np.array([1, 0, 0])], glued, 3).topology)
    assert rim.all()
    # where the two charts meet, each shows the other's texel; at the far corners its own
    assert halo.tolist() == [[0, 9, 15, 6], [2, 11, 17, 8]]
