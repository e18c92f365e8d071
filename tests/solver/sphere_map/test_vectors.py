"""Vectors as tuples against numpy, and the tangent frame everywhere on the sphere."""

import numpy as np
import pytest

from ripple_sim.solver.layouts.sphere_map.energy import combine, cross, dot, row, set_row, subtract, tangent_frame, unit

AXES = [tuple(sign * each) for each in np.eye(3) for sign in (1.0, -1.0)]
# the frame changes its recipe where |x| = 0.6
BORDER = [(x, 0.0, np.sqrt(1 - x * x)) for x in (0.6, np.nextafter(0.6, 0), np.nextafter(0.6, 1), -0.6)]
RANDOM = [tuple(each / np.linalg.norm(each)) for each in np.random.default_rng(0).standard_normal((10, 3))]


@pytest.mark.parametrize("p", [*AXES, *BORDER, *RANDOM])
def test_tangent_frame_is_orthonormal_and_right_handed(p):
    x, y = tangent_frame(p)
    frame = np.array([x, y, p])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1, abs=1e-14)


def test_vector_algebra_agrees_with_numpy():
    for a, b in np.random.default_rng(1).standard_normal((5, 2, 3)):
        np.testing.assert_array_equal(subtract(tuple(a), tuple(b)), a - b)
        np.testing.assert_allclose(dot(tuple(a), tuple(b)), a @ b, rtol=1e-13)
        np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), rtol=1e-13)
        np.testing.assert_allclose(combine(2.0, tuple(a), -0.5, tuple(b)), 2 * a - b / 2, rtol=1e-13)


@pytest.mark.parametrize("length", [1e-100, 1e-3, 1.0, 1e100])
def test_unit_keeps_the_direction_of_vectors_of_any_length(length):
    direction = np.array([2.0, -1.0, 2.0]) / 3
    np.testing.assert_allclose(unit(tuple(length * direction)), direction, rtol=1e-15)


def test_unit_leaves_the_zero_vector_as_it_is():
    assert unit((0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_writing_a_row_changes_no_other_row():
    array = np.arange(12.0).reshape(4, 3)
    expected = array.copy()
    expected[2] = expected[1]
    set_row(array, 2, row(array, 1))
    np.testing.assert_array_equal(array, expected)
