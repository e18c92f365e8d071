"""The cells: waves over sheared quads."""

import numpy as np
import pytest

from ripple_sim.solver.texels.cells import polygons, quad


@pytest.mark.parametrize(("long", "angle"), [(1.0, 30.0), (2.0, 35.0), (3.0, 20.0), (1.3, 150.0)])
def test_waves_over_sheared_quads_are_in_time_in_the_mean_over_their_directions(long: float, angle: float) -> None:
    east = np.array([long, 0.0, 0.0])
    north = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    south, north_side, west, east_side, rising, falling, area = quad(east, north, east + north)
    direction = np.linspace(0, np.pi, 180, endpoint=False)
    errors = []
    for k in (0.2, 0.1):
        wave = k * np.stack([np.cos(direction), np.sin(direction), 0 * direction], axis=1)
        theta, phi = wave @ east, wave @ north
        # every side belongs to two quads
        squared = (
            (south + north_side) * (2 - 2 * np.cos(theta))
            + (west + east_side) * (2 - 2 * np.cos(phi))
            + rising * (2 - 2 * np.cos(theta + phi))
            + falling * (2 - 2 * np.cos(theta - phi))
        ) / area
        errors.append(abs(np.mean(squared / k**2) - 1))
    # the error in k^2 is gone, that in k^4 is left
    assert errors[1] < errors[0] / 14


def test_a_quad_of_any_convex_shape_is_next_to_exact_for_linear_functions() -> None:
    rng = np.random.default_rng(5)
    ends = np.array([(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)])
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    for _ in range(50):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 4))[[0, 1, 3, 2]]
        corners = np.stack([np.cos(angle), 0.5 * np.sin(angle), 0 * angle], axis=1) @ turn
        slope = turn.T @ np.array([*rng.standard_normal(2), 0.0])
        *weights, area = quad(*(corners[1:] - corners[0]))
        if area < 0.1:
            continue
        matrix = np.zeros((4, 4))
        for (i, j), weight in zip(ends, weights, strict=True):
            matrix[[i, j], [j, i]] -= weight
            matrix[[i, j], [i, j]] += weight
        assert np.einsum("i,ij,j", corners @ slope, matrix, corners @ slope) == pytest.approx(
            area * slope @ slope, rel=2e-3
        )
        # three motions have energy, a constant has none, and none has less than none
        values = np.linalg.eigvalsh(matrix)
        assert values[0] == pytest.approx(0, abs=1e-12 * values[-1]) and values[1] > 1e-3 * values[-1]


@pytest.mark.parametrize("corners", [3, 4, 5, 8])
def test_a_cell_with_many_corners_is_exact_for_linear_functions(corners: int) -> None:
    rng = np.random.default_rng(corners)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    flat = np.stack([np.cos(angle), 0.6 * np.sin(angle), 0 * angle], axis=1)
    weights, areas = (each[:, 0] for each in polygons(flat.T[..., None]))
    slope = np.array([0.7, -1.3, 0.0])
    first, second = np.triu_indices(corners, 1)
    energy = weights @ (flat[first] @ slope - flat[second] @ slope) ** 2 / 2
    x, y, _ = flat.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert energy == pytest.approx(area * slope @ slope / 2)
    assert areas.sum() == pytest.approx(area)
