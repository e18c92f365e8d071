"""Wraps: a closed surface round any set of triangles, at a given distance."""

import igl
import numpy as np
import pytest
from all_kinds import BALL, cube, torus
from known_meshes import known_mesh
from sound import assert_sound
from surfaces import joined, moved, sphere

from ripple_sim.solver import Mesh, MeshError, Wrap, load_mesh, wrap


def distances(wrapped: Wrap) -> np.ndarray:
    """Of the surface from the object, in offsets."""
    found = igl.point_mesh_squared_distance(wrapped.mesh.V, wrapped.wrapped.V, wrapped.wrapped.F)[0]
    return np.sqrt(found) / wrapped.offset


def test_a_ball_gets_a_larger_ball() -> None:
    found = wrap(sphere(3), 0.05)
    assert found.offset == pytest.approx(0.1, rel=1e-3)
    assert_sound(found.mesh)
    assert found.mesh.closed
    assert found.mesh.genus.tolist() == [0]
    # the grid's linear interpolation errs by an eighth of the spacing squared over the radius
    np.testing.assert_allclose(np.linalg.norm(found.mesh.V, axis=1), 1.1, atol=0.01)
    np.testing.assert_allclose(distances(found), 1, atol=0.1)


def test_bodies_that_intersect_get_one_outer_surface() -> None:
    found = wrap(
        joined(sphere(3), moved(sphere(3), (1, 0, 0)), moved(sphere(3), (0.4, 0.3, 0), 0.4)), 0.03
    )
    assert found.mesh.component_count == 1
    assert found.mesh.genus.tolist() == [0]
    apart = np.linalg.norm(found.mesh.V, axis=1), np.linalg.norm(found.mesh.V - [1, 0, 0], axis=1)
    assert np.minimum(*apart).min() > 1
    volume = 2 * 4 / 3 * np.pi * 1.09**3 - np.pi / 12 * (4 * 1.09 + 1) * (2 * 1.09 - 1) ** 2
    assert found.mesh.volume == pytest.approx(volume, rel=0.02)


def test_pieces_that_are_far_apart_get_a_surface_each_and_near_ones_share_one() -> None:
    near = 2.1
    far = 2.8
    for centre, parts in (near, 1), (far, 2):
        found = wrap(joined(sphere(3), moved(sphere(3), (centre, 0, 0))), 0.04)
        assert found.mesh.component_count == parts
    assert found.mesh.notes[-1].startswith(
        "wrapped, 0.192 m off: 2 parts in 2 closed surfaces with 0 handles, "
    )


def test_a_shell_with_a_small_hole_is_solid_and_one_with_a_wide_hole_stays_hollow() -> None:
    ball = sphere(4)
    V = ball.V
    F = ball.F
    top = V[F].mean(axis=1)[:, 2]
    solid = wrap(Mesh.from_arrays(V, F[top < 0.997]), 0.05).mesh
    hollow = wrap(Mesh.from_arrays(V, F[top < 0.7]), 0.05).mesh
    assert solid.volume == pytest.approx(4 / 3 * np.pi * 1.1**3, rel=0.02)
    assert hollow.volume < 0.6 * solid.volume
    assert hollow.genus.tolist() == [0]


@pytest.mark.parametrize("cracked", [False, True])
def test_a_wrapped_ring_keeps_its_hole_even_if_it_is_cracked(cracked: bool) -> None:
    V, F = torus()
    if cracked:
        middle = V[F].mean(axis=1, keepdims=True)
        V = (middle + 0.95 * (V[F] - middle)).reshape(-1, 3)
        F = np.arange(F.size).reshape(-1, 3)
    mesh = Mesh.from_arrays(V, F)
    found = wrap(mesh, 0.03)
    assert mesh.component_count == (len(F) if cracked else 1)
    assert found.mesh.genus.tolist() == [1]


def test_a_lone_triangle_and_a_needle_are_wrapped() -> None:
    for points in (np.eye(3), np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]])):
        found = wrap(Mesh.from_arrays(points, [[0, 1, 2]]), 0.05)
        assert_sound(found.mesh)
        assert found.mesh.genus.tolist() == [0]
        assert distances(found).max() < 1.5


def test_the_wrapped_object_moves_with_its_surface() -> None:
    mesh = joined(Mesh.from_arrays(*cube()), moved(sphere(3), (0.2, 0, 0), 0.4))
    found = wrap(mesh, 0.05)
    assert found.triangles.shape == (len(mesh.V),)
    np.testing.assert_allclose(found.barycentrics.sum(axis=1), 1)
    assert found.barycentrics.min() > -1e-9
    nearest = np.sqrt(igl.point_mesh_squared_distance(mesh.V, found.mesh.V, found.mesh.F)[0])
    np.testing.assert_allclose(
        np.linalg.norm(found.interpolate(found.mesh.V) - mesh.V, axis=1), nearest, atol=1e-12
    )
    # a linear field is interpolated without error
    slope = np.array([0.3, -0.2, 0.5])
    V = found.mesh.V
    np.testing.assert_allclose(
        found.interpolate(V @ slope), found.interpolate(V) @ slope, atol=1e-12
    )


def test_units_and_place_do_not_matter() -> None:
    V = np.array(BALL.vertices) * [1, 2, 0.5]
    F = np.array(BALL.faces)
    for scale, shift in (1e-3, 0), (1e3, 5e3):
        here = wrap(Mesh.from_arrays(V, F), 0.05)
        there = wrap(Mesh.from_arrays(V * scale + shift, F), 0.05)
        assert there.mesh.area == pytest.approx(here.mesh.area * scale**2, rel=1e-3)


@pytest.mark.parametrize("offset", [0.0, 0.003, 0.5, float("nan")])
def test_an_offset_out_of_range_is_refused(offset: float) -> None:
    with pytest.raises(MeshError, match=rf"must be 0\.004 to 0\.2 .*, got {offset}"):
        wrap(Mesh.from_arrays(*cube()), offset)


@pytest.mark.parametrize("name", ["suzanne.obj", "several-parts-teapot.obj"])
def test_known_meshes_in_several_open_parts_get_one_closed_surface(name: str) -> None:
    mesh = load_mesh(known_mesh(f"bad/{name}"), wrap=True)
    assert mesh.closed
    assert mesh.component_count == 1
    assert mesh.genus[0] == ("teapot" in name)  # its handle
    assert mesh.name == name
