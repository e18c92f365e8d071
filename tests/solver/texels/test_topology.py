"""Topology of charts: what lies beyond sides and corners, and sampling across them."""

import numpy as np
import pytest
from hand_made import RIM, eigenvalues, flat_torus, polygon, square

from ripple_sim.solver import AtlasError, TexelMesh, TexelTopology, glue
from ripple_sim.solver.layouts.cube import cube_topology
from ripple_sim.solver.texels import sampling_matrix, with_filled_halo

TOPOLOGIES = {
    "cube": lambda: cube_topology(4),
    "torus": lambda: flat_torus(4).topology,
    "square": lambda: square(4).topology,
    "pentagon": lambda: polygon(5, 4).topology,
    # front and back of a pillow: they share all four sides
    "pillow": lambda: glue(
        np.array([[(1, 0), (1, 3), (1, 2), (1, 1)], [(0, 0), (0, 3), (0, 2), (0, 1)]]), 4
    ),
}


@pytest.fixture(params=TOPOLOGIES)
def topology(request: pytest.FixtureRequest) -> TexelTopology:
    return TOPOLOGIES[request.param]()


def test_a_side_may_be_glued_to_the_next_side_of_its_own_chart() -> None:
    # a cone: south on west, its tip in corner 0
    topology = glue(np.array([[(0, 3), RIM, RIM, (0, 0)]]), 3)
    np.testing.assert_array_equal(topology.halo[0, 0, 1:-1], [0, 3, 6])
    np.testing.assert_array_equal(topology.halo[0, 1:-1, 0], [0, 1, 2])
    assert topology.valence.tolist() == [[1, 0, 0, 0]]
    assert topology.corners[0, 1] == topology.corners[0, 3]


def test_every_step_over_a_border_leads_back(topology: TexelTopology) -> None:
    n = topology.shape[1]
    neighbours = {texel: set() for texel in range(topology.texel_count)}
    for chart, row, column in np.ndindex(*topology.shape):
        texel = (chart * n + row) * n + column
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            place = chart, row + 1 + down, column + 1 + right
            if not topology.rim[place]:
                neighbours[texel].add(int(topology.halo[place]))
    for texel, others in neighbours.items():
        assert all(texel in neighbours[other] for other in others)


def test_a_field_with_halo_is_0_where_no_texel_lies() -> None:
    around = TOPOLOGIES["cube"]().with_halo(np.ones((6, 4, 4, 2)))
    assert around.shape == (6, 6, 6, 2)
    empty = np.zeros((6, 6), bool)
    empty[[0, 0, -1, -1], [0, -1, 0, -1]] = True
    assert ((around == 0).all(axis=(0, 3)) == empty).all()
    assert (around[:, ~empty] == 1).all()


def test_addresses_copy_the_same_halo_as_the_table(topology: TexelTopology) -> None:
    field = np.random.default_rng(1).standard_normal(topology.shape)
    flat = np.zeros(topology.halo.size)
    texels, ghosts, sources = topology.addresses
    flat[texels] = field.ravel()
    flat[ghosts] = flat[sources]
    np.testing.assert_array_equal(flat.reshape(topology.halo.shape), topology.with_halo(field))
    charts, n, _ = topology.shape
    assert len(topology.addresses[1]) == charts * (4 * n + 4) - (topology.halo < 0).sum()


UNIT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
ROWS = [0, 0, -1, -1]
COLUMNS = [0, -1, -1, 0]


def random_gluing(charts: int, rims: int, seed: int) -> np.ndarray:
    """Random pairs of sides; an even number of sides stay rims."""
    rng = np.random.default_rng(seed)
    sides = rng.permutation(4 * charts)
    glued = np.full((4 * charts, 2), -1)
    for a, b in sides[rims:].reshape(-1, 2):
        glued[a] = divmod(b, 4)
        glued[b] = divmod(a, 4)
    return glued.reshape(charts, 4, 2)


def points_by_merging(glued: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Point of each corner by merging glued sides, and whether a rim ends there.

    Side s runs from corner s to corner s + 1, against the side that it is glued to.
    """
    charts = len(glued)
    point = np.arange(4 * charts).reshape(charts, 4)
    at_rim = np.zeros((charts, 4), bool)
    for _ in range(4 * charts):  # enough for a number to reach every corner of its point
        for chart, side in np.ndindex(charts, 4):
            other, back = glued[chart, side]
            if other < 0:
                continue
            for a, b in (
                ((chart, side), (other, (back + 1) % 4)),
                ((chart, (side + 1) % 4), (other, back)),
            ):
                point[a] = point[b] = min(point[a], point[b])
    for chart, side in np.argwhere(glued[..., 0] < 0):
        ends = point[chart, side], point[chart, (side + 1) % 4]
        at_rim |= np.isin(point, ends)
    return point, at_rim


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("charts", "rims"), [(1, 0), (1, 2), (2, 0), (3, 4), (5, 0), (6, 10)])
def test_corners_of_any_gluing_are_those_that_merge(charts: int, rims: int, seed: int) -> None:
    glued = random_gluing(charts, rims, seed)
    topology = glue(glued, 3)
    point, at_rim = points_by_merging(glued)
    # corners are numbered in another order
    pairs = np.unique([topology.corners.ravel(), point.ravel()], axis=1)
    assert pairs.shape[1] == len(np.unique(topology.corners)) == len(np.unique(point))
    assert topology.corners.min() == 0 and topology.corners.max() == len(np.unique(point)) - 1
    meeting = (point.ravel() == point.ravel()[:, None]).sum(axis=1).reshape(charts, 4)
    np.testing.assert_array_equal(topology.valence, np.where(at_rim, 0, meeting))
    # one polygon for each point that does not fit the stencil
    limit = np.where(at_rim, 2, 4)
    assert len(topology.polygons) == len(np.unique(point[meeting > limit]))
    if rims == 0:
        # Euler: C faces, 2 C edges; each part has at most the characteristic of a sphere, and that
        # of a handle less 2
        assert (topology.corners.max() + 1 - charts) % 2 == 0


def test_the_cube_has_eight_corners_of_three_charts() -> None:
    topology = cube_topology(5)
    assert (topology.valence == 3).all()
    assert np.bincount(topology.corners.ravel()).tolist() == [3] * 8
    assert (topology.halo[:, ROWS, COLUMNS] == -1).all()
    assert topology.polygons == ()


@pytest.mark.parametrize(("name", "mode", "valence"), [("torus", "wrap", 4), ("square", "edge", 0)])
def test_a_torus_goes_round_and_a_rim_repeats_the_last_texels(
    name: str, mode: str, valence: int
) -> None:
    topology = TOPOLOGIES[name]()
    np.testing.assert_array_equal(
        topology.halo[0], np.pad(np.arange(16).reshape(4, 4), 1, mode=mode)
    )
    np.testing.assert_array_equal(topology.rim[0, 0], 6 * [mode == "edge"])
    assert (topology.valence == valence).all()
    field = noise(1, 4, 4)
    np.testing.assert_array_equal(
        with_filled_halo(topology, field)[0], np.pad(field[0], 1, mode=mode)
    )


def l_shape(n: int, turns: tuple[int, int, int]) -> TexelMesh:
    """Three unit squares round an inner corner of the rim.

    Each chart begins at any of its corners. The surface ends at its last texels.
    """
    squares = UNIT + np.array([[[0, 0, 0]], [[1, 0, 0]], [[0, 1, 0]]])
    corners = np.stack(
        [np.roll(square, -turn, axis=0) for square, turn in zip(squares, turns, strict=True)]
    )
    glued = np.full((3, 4, 2), -1)
    for (a, side), (b, back) in (((0, 1), (1, 3)), ((0, 2), (2, 0))):
        mine = (side - turns[a]) % 4
        other = (back - turns[b]) % 4
        glued[a, mine] = (b, other)
        glued[b, other] = (a, mine)
    u = (np.arange(n) + 0.5) / n
    s = u[None, None, :, None]
    t = u[None, :, None, None]
    a, b, c, d = (corners[:, k, None, None] for k in range(4))
    return TexelMesh.of(
        glue(glued, n), (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
    )


@pytest.mark.parametrize("turns", [(0, 0, 0), (1, 2, 3), (3, 0, 2)])
def test_three_charts_at_a_rim_make_a_triangle_wherever_the_charts_begin(
    turns: tuple[int, int, int],
) -> None:
    n = 4
    texels = l_shape(n, turns)
    [cell] = texels.topology.polygons
    points = texels.positions.reshape(-1, 3)[cell]
    # counter-clockwise, the three texels nearest to the inner corner
    assert np.cross(*np.diff(points, axis=0))[2] == pytest.approx((1 / n) ** 2)
    np.testing.assert_allclose(np.abs(points - [1, 1, 0])[:, :2], 0.5 / n)
    # all squares of four texels, but for those that touch the missing quarter, and the triangle
    assert texels.areas.sum() == pytest.approx(((2 * n - 1) ** 2 - n**2 + 0.5) / n**2)


def test_charts_side_by_side_are_one_chart() -> None:
    whole = square(12)
    parts = polygon(4, 6)
    # the same square, turned by an eighth and 2 ** 0.5 as wide
    np.testing.assert_allclose(
        eigenvalues(parts, 12), eigenvalues(whole, 12) / 2, rtol=1e-9, atol=1e-9
    )


def test_invalid_gluings_and_positions_are_refused() -> None:
    with pytest.raises(AtlasError, match="not glued back"):
        glue(np.array([[(0, 2), (0, 3), (0, 1), (0, 0)]]), 4)
    with pytest.raises(AtlasError, match=r"shape .*, got \(1, 4\)"):
        glue(np.zeros((1, 4)), 4)
    with pytest.raises(AtlasError, match="texel positions must have shape"):
        TexelMesh.of(square(4).topology, np.zeros((4, 4, 3)))
    with pytest.raises(AtlasError, match="must be finite"):
        square(4).with_positions(np.full((1, 4, 4, 3), np.nan))


def noise(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).standard_normal(shape).astype(np.float32)


@pytest.mark.parametrize(
    "topology", [cube_topology(4), polygon(3, 4).topology, polygon(4, 4).topology]
)
def test_charts_that_meet_in_a_corner_agree_on_its_value(topology) -> None:
    around = with_filled_halo(topology, noise(*topology.shape)).astype(np.float64)
    inner = topology.valence > 0
    last = around.shape[1] - 2
    places = (0, 0), (0, last), (last, last), (last, 0)
    values = np.stack(
        [around[:, r : r + 2, c : c + 2].mean(axis=(1, 2)) for r, c in places], axis=1
    )
    for point in np.unique(topology.corners[inner]):
        here = values[topology.corners == point]
        assert len(here) >= 3
        np.testing.assert_allclose(here, here[0], atol=1e-6)


def test_constants_stay_constant_even_in_corners_of_five_charts() -> None:
    for topology in (polygon(5, 4).topology, cube_topology(4)):
        np.testing.assert_allclose(
            with_filled_halo(topology, np.full(topology.shape, 2.5, np.float32)), 2.5
        )


def at_side(side: int, along: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of places on a side of a chart, 0 to 1 from its first corner to its second."""
    low = np.full_like(along, -0.5)
    high = np.full_like(along, n - 0.5)
    there = n * along - 0.5
    return ((low, there), (there, high), (high, there[::-1]), (there[::-1], low))[side]


@pytest.mark.parametrize(
    "topology", [cube_topology(4), polygon(3, 4).topology, polygon(4, 4).topology]
)
def test_both_charts_agree_along_a_glued_side_up_to_its_corners(topology) -> None:
    n = topology.shape[1]
    field = np.random.default_rng(0).standard_normal(topology.texel_count)
    along = np.linspace(0, 1, 41)
    for chart, side in np.argwhere(topology.glued[..., 0] >= 0):
        other, back = topology.glued[chart, side]
        here = sampling_matrix(topology, np.full(41, chart), *at_side(side, along, n)) @ field
        there = sampling_matrix(topology, np.full(41, other), *at_side(back, along, n)) @ field
        np.testing.assert_allclose(here, there[::-1], atol=1e-12)


@pytest.mark.parametrize(
    "topology", [cube_topology(4), flat_torus(4).topology, polygon(5, 4).topology]
)
def test_weights_are_a_mean_of_at_most_four_texels(topology) -> None:
    rng = np.random.default_rng(1)
    chart = rng.integers(0, topology.shape[0], 500)
    matrix = sampling_matrix(topology, chart, *rng.uniform(-0.5, 3.5, (2, 500)))
    dense = matrix.toarray()
    assert dense.min() >= 0
    np.testing.assert_allclose(dense.sum(axis=1), 1)
    assert (np.count_nonzero(dense, axis=1) <= 4).all()
