"""Meshes: validated, and refused by name; normals of vertices; bodies that touch stay bodies."""

import numpy as np
import pytest
from all_kinds import BALL, cube, shuffled, torus
from sound import assert_sound, assert_unchanged_when_read_again
from surfaces import sphere

from ripple_sim.solver import Mesh, MeshError, build_atlas
from ripple_sim.solver.mesh import vertex_normals


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda V, F: (V, F[1:]), r"open: 3 boundary edges round 1 hole \(one near \(.*repair"),
        (lambda V, F: (V, F[:2]), "open: 4 boundary edges round 1 hole"),
        (lambda V, F: (np.vstack([V, V + 3]), np.vstack([F, F + 8])), "2 separate parts"),
        (
            lambda V, F: (np.vstack([V, [[5, 5, 5]]]), np.vstack([F, [[0, 1, 8]]])),
            "2 separate parts.*and open.*cut",
        ),
        (lambda V, F: (np.vstack([V, V + 1]), np.vstack([F, F + 8])), "2 separate parts"),
        (lambda V, F: (V * [1, 1, 0], F), "open|no volume"),
        (lambda V, F: torus(), "genus 1"),
    ],
)
def test_a_surface_that_the_cube_does_not_fit_is_refused_by_name(change, said: str) -> None:
    mesh = Mesh.from_arrays(*change(*cube()), name="thing.obj")
    with pytest.raises(MeshError, match=rf"^thing\.obj is .*{said}") as refused:
        build_atlas(mesh, 8, cache=False, layout="cube")
    assert "\n" not in str(refused.value)


def test_normals_of_a_sphere_are_radial() -> None:
    ball = sphere(3)
    np.testing.assert_allclose(ball.vertex_normals, ball.V, atol=0.02)


def test_the_normal_of_a_spike_points_outwards_of_every_triangle() -> None:
    # many narrow triangles face up, two wide ones down and to the side: their mean would point into
    # those
    angle = np.concatenate([np.linspace(0, np.pi, 24), [1.5 * np.pi]])
    rim = np.stack([np.cos(angle), np.sin(angle), np.where(angle > np.pi, -6.0, -0.1)], axis=1)
    V = np.concatenate([[[0.0, 0.0, 0.0]], rim])
    F = np.array([[0, 1 + i, 1 + (i + 1) % 25] for i in range(25)])
    mesh = Mesh.from_arrays(V, F)
    a, b, c = mesh.V[mesh.F].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    cosine = (
        np.einsum("mkj,mj->mk", mesh.vertex_normals[mesh.F], normal)
        / np.linalg.norm(normal, axis=1)[:, None]
    )
    assert cosine.min() > 0.1
    spun = vertex_normals(V[:, [1, 2, 0]], F)
    np.testing.assert_allclose(spun, mesh.vertex_normals[:, [1, 2, 0]], atol=1e-9)


@pytest.mark.parametrize(
    ("damage", "name"),
    [
        (lambda V, F: (np.where(np.arange(8)[:, None] == 2, np.nan, V), F), "NaN"),
        (lambda V, F: (V, F + 1), "indices must be 0 to 7, got"),
        (lambda V, F: (V, F[:1, [0, 1, 1]]), "no triangle with an area"),
        (lambda V, F: (V * [1, 0, 0], F), "no triangle with an area"),
        (lambda V, F: (V * 1e15, F), "size must be .*, got 1e"),
        (lambda V, F: (V, F * 1.5), "integers"),
        (lambda V, F: (V, F[:0]), "m > 0"),
    ],
)
def test_meshes_that_are_no_surfaces_are_refused_by_name(damage, name: str) -> None:
    with pytest.raises(MeshError, match=name):
        Mesh.from_arrays(*damage(*cube()))


TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.5, 0.3, 0.8]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
)


def merged(*bodies: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Several bodies, equal positions being one vertex."""
    V = np.vstack([V for V, _ in bodies])
    first = np.cumsum([0, *(len(V) for V, _ in bodies)])
    F = np.vstack([F + at for (_, F), at in zip(bodies, first, strict=False)])
    V, number = np.unique(V.round(9), axis=0, return_inverse=True)
    return V, number.ravel()[F]


def square(*corners: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.array(corners, dtype=float), np.array([[0, 1, 2], [0, 2, 3]])


def sound(V: np.ndarray, F: np.ndarray) -> Mesh:
    mesh = Mesh.from_arrays(V, F)
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    return mesh


@pytest.mark.parametrize("turned", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("loose", [False, True])
@pytest.mark.parametrize(
    ("bodies", "volume"),
    [
        ((cube(), (cube()[0] + [1, 1, 0], cube()[1])), 2.0),
        ((TETRAHEDRON, (TETRAHEDRON[0] * [1, -1, -1], TETRAHEDRON[1][:, ::-1])), 0.24),
        ((cube(), (cube()[0] + 1, cube()[1])), 2.0),
    ],
    ids=["cubes at an edge", "tetrahedra at an edge", "cubes at a corner"],
)
def test_two_bodies_that_touch_stay_two(bodies, volume: float, loose: bool, turned: float) -> None:
    mesh = sound(*shuffled(*merged(*bodies), 1, turned, loose))
    assert mesh.closed
    assert mesh.component_count == 2
    assert mesh.genus.tolist() == [0, 0]
    assert mesh.volume == pytest.approx(volume)
    assert any(note.startswith("cut apart") for note in mesh.notes)


def test_a_wall_comes_off_the_floor_on_which_it_stands() -> None:
    left = square((0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0))
    right = square((1, 0, 0), (2, 0, 0), (2, 2, 0), (1, 2, 0))
    wall = square((1, 0, 0), (1, 2, 0), (1, 2, 1), (1, 0, 1))
    mesh = sound(*merged(left, right, wall))
    assert mesh.component_count == 2
    floor = np.flatnonzero((mesh.V[mesh.F][..., 2] == 0).all(axis=1))
    assert len(np.unique(mesh.components[floor])) == 1
    assert mesh.notes == ("cut apart along 1 edge where more than two triangles met",)


def test_an_inner_wall_comes_off_its_box() -> None:
    V, F = cube()
    half = V * [0.5, 1, 1] + [0.25, 0, 0]
    mesh = sound(*merged((half, F), (half * [-1, 1, 1], F[:, ::-1])))
    # the wall is there twice, and once is enough
    assert mesh.component_count == 2
    assert mesh.volume == pytest.approx(1)
    assert [len(rim) for rim in mesh.rims] == [4]
    assert any("repeated" in note for note in mesh.notes)


def test_a_fin_comes_off_and_the_ball_stays_closed() -> None:
    V = np.array(BALL.vertices)
    F = np.array(BALL.faces)
    a, b = F[0, :2]
    mesh = sound(np.vstack([V, 2 * V[a]]), np.vstack([[[a, b, len(V)]], F]))
    assert mesh.component_count == 2
    assert mesh.volume == pytest.approx(BALL.volume)
    assert [len(rim) for rim in mesh.rims] == [3]
