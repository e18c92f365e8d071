"""From points on triangles to directions and texels, against the same written with whole arrays."""

import numpy as np
import pytest

from ripple_sim.solver import Atlas
from ripple_sim.solver.layouts.cube.convention import cube_chart_points, cube_rotations, texel_directions
from ripple_sim.solver.layouts.cube.rays import sphere_directions, texel_at


@pytest.mark.parametrize("n", [4, 7, 32])
def test_texels_are_those_of_the_rounded_coordinates(n: int) -> None:
    rng = np.random.default_rng(n)
    directions = rng.standard_normal((4000, 3))
    # edges and corners of the cube too, which belong to several charts
    directions[:72] = np.concatenate(
        [[1, 1, 0] @ cube_rotations(), [1, 1, 1] @ cube_rotations(), [1, 0, 0] @ cube_rotations()]
    )
    chart, row, column = cube_chart_points(directions, n)
    row, column = (np.clip(np.rint(each).astype(int), 0, n - 1) for each in (row, column))
    found = [texel_at(*direction, n) for direction in directions]
    np.testing.assert_array_equal(found, (chart * n + row) * n + column)
    found = [texel_at(*direction, n) for direction in texel_directions(n).reshape(-1, 3)]
    np.testing.assert_array_equal(found, np.arange(6 * n * n))


def test_directions_interpolate_the_sphere_map(animal: Atlas) -> None:
    V, F, sphere = animal.mesh.V, animal.mesh.F, animal.sphere
    rng = np.random.default_rng(0)
    triangles, weights = rng.integers(0, len(F), 500), rng.dirichlet(np.ones(3), 500)
    points = np.einsum("ij,ijk->ik", weights, V[F[triangles]])
    expected = np.einsum("ij,ijk->ik", weights, sphere[F[triangles]])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(sphere_directions(V, F, sphere, triangles, points), expected, atol=1e-9)


def test_a_triangle_without_area_gives_its_middle() -> None:
    V = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    [found] = sphere_directions(V, np.array([[0, 1, 2]]), np.eye(3), np.array([0]), V[:1])
    np.testing.assert_allclose(found, np.full(3, 3**-0.5))
