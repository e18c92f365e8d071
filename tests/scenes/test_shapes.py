"""The shipped meshes: closed, genus 0, outward, even, and reproducible."""

import functools

import igl
import numpy as np
import pytest
from sound import assert_sound

from ripple_sim.scenes import shapes
from ripple_sim.solver import Mesh


@functools.cache
def made(name):
    return getattr(shapes, name)()


@pytest.fixture(params=["duck", "limbed", "peanut"])
def shape(request):
    return made(request.param)


def signed_volume(V, F):
    return np.linalg.det(V[F]).sum() / 6


def test_shapes_are_sound_closed_of_genus_zero_and_have_no_slivers(shape):
    V, F = shape
    mesh = Mesh.from_arrays(V, F)
    assert_sound(mesh)
    assert mesh.notes == ()  # nothing was mended
    assert mesh.closed and mesh.genus.tolist() == [0]
    assert signed_volume(V, F) > 0
    assert np.degrees(igl.internal_angles(V, F)).min() > 15
    normals = igl.per_face_normals(V, F, np.zeros(3))
    corners = igl.per_vertex_normals(V, F)[F]
    assert np.einsum("ij,ikj->ik", normals, corners).min() > 0, "a triangle is folded over"


def test_duck_stands_on_the_floor_and_is_as_large_as_promised():
    V, F = made("duck")
    assert 8_000 <= len(F) <= 12_000
    assert V[:, 2].min() == 0.0
    assert np.ptp(V[:, 0]) == pytest.approx(1.0, abs=0.1)
    on_the_floor = V[V[:, 2] < 1e-3]
    assert np.all(np.ptp(on_the_floor[:, :2], axis=0) > [0.3, 0.15]), (
        "it has no flat bottom to stand on"
    )


def test_polygonised_ball_converges_to_the_ball_at_second_order():
    ball = shapes.sphere((0.1, -0.05, 0.02), 0.5)
    cells = np.array([0.16, 0.08, 0.04])
    errors = []
    for cell in cells:
        V, F = shapes.polygonise(ball, ((-0.6, -0.7, -0.7), (0.8, 0.7, 0.7)), cell)
        assert np.abs(ball(V)).max() < 1e-9
        errors.append(4 / 3 * np.pi * 0.5**3 - signed_volume(V, F))
    order = np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize(
    "solid",
    [
        shapes.sphere((0.1, 0.2, 0.3), 0.2),
        shapes.capsule((-0.2, 0.0, 0.1), (0.3, 0.1, 0.0), 0.1),
        shapes.rounded_cone((-0.2, 0.0, 0.1), (0.3, 0.1, 0.0), 0.2, 0.05),
        shapes.rounded_cone((-0.2, 0.0, 0.1), (0.3, 0.1, 0.0), 0.05, 0.2),
        shapes.pebble((0.0, 0.1, 0.0), 0.2, 0.05),
        shapes.half_space((0.6, 0.0, 0.8), 0.1),
    ],
    ids=["sphere", "capsule", "narrowing cone", "widening cone", "pebble", "half space"],
)
def test_distance_grows_by_one_metre_a_metre_outside(solid):
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (2000, 3))
    points = points[solid(points) > 0.01]
    slopes = np.linalg.norm(shapes.gradient(solid, points), axis=1)
    np.testing.assert_allclose(slopes, 1.0, atol=1e-4)
    nearest = shapes.project(solid, points, steps=1)
    np.testing.assert_allclose(solid(nearest), 0.0, atol=1e-4)
