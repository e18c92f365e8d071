"""The cube map's geometry: directions, neighbours across edges, symmetries."""

import numpy as np
import pytest

from ripple_sim.solver import AtlasError
from ripple_sim.solver.layouts.cube.convention import (
    check_resolution,
    cube_chart_points,
    cube_rotations,
    cube_topology,
    permute_texels,
    texel_directions,
)


@pytest.mark.parametrize("n", [4, 5, 16, 33])
def test_cube_chart_points_invert_texel_directions(n: int) -> None:
    chart, row, column = (x.reshape(6, n, n) for x in cube_chart_points(texel_directions(n), n))
    assert (chart == np.arange(6)[:, None, None]).all()
    np.testing.assert_allclose(row, np.broadcast_to(np.arange(n)[:, None], (6, n, n)), atol=1e-9)
    np.testing.assert_allclose(column, np.broadcast_to(np.arange(n), (6, n, n)), atol=1e-9)


@pytest.mark.parametrize("n", [4, 7, 16])
def test_the_halo_holds_the_nearest_texels_across_the_edges(n: int) -> None:
    directions = texel_directions(n).reshape(-1, 3)
    index = cube_topology(n).halo
    for chart in range(6):
        for own, beside in (
            (index[chart, 1, 1:-1], index[chart, 0, 1:-1]),
            (index[chart, -2, 1:-1], index[chart, -1, 1:-1]),
            (index[chart, 1:-1, 1], index[chart, 1:-1, 0]),
            (index[chart, 1:-1, -2], index[chart, 1:-1, -1]),
        ):
            other = (directions[own] @ directions.T).copy()
            same_chart = np.arange(6 * n * n) // (n * n) == chart
            other[:, same_chart] = -1
            # the outermost texels stand at a cube corner, equally near to two charts
            np.testing.assert_array_equal(other.argmax(axis=1)[1:-1], beside[1:-1])
            assert (other[np.arange(n), beside] > other.max(axis=1) - 1e-12).all()
    assert (index < 0).sum() == 24


def test_neighbourhood_is_symmetric() -> None:
    n = 8
    index = cube_topology(n).halo
    pairs = set()
    for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        a = index[:, 1:-1, 1:-1].ravel()
        b = index[:, 1 + dr : n + 1 + dr, 1 + dc : n + 1 + dc].ravel()
        pairs |= set(zip(a.tolist(), b.tolist(), strict=True))
    assert all((b, a) in pairs for a, b in pairs)
    assert len(pairs) == 4 * 6 * n * n


def test_rotations_permute_texels_exactly() -> None:
    directions = texel_directions(9)
    rotations = cube_rotations()
    assert len(rotations) == 24
    assert len({rotation.tobytes() for rotation in rotations}) == 24
    for rotation in rotations:
        assert np.linalg.det(rotation) == pytest.approx(1)
        # the texel at R d shows what stood at d: its own direction turned back
        np.testing.assert_allclose(permute_texels(directions, rotation), directions @ rotation, atol=1e-15)


@pytest.mark.parametrize("bad", [0, 3, 2.5, -8, 10_000])
def test_invalid_resolution_is_named(bad: float) -> None:
    with pytest.raises(AtlasError, match=r"valid is a whole number"):
        check_resolution(bad)
