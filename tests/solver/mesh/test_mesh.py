"""Meshes: validated, measured, and refused by name.

What the cube layout refuses: open surfaces, several parts, handles, no volume.

Normals of vertices: those of the surface, and outwards of every triangle at tips and knife edges too.
"""

import numpy as np
import pytest
import trimesh
from solids import cube, torus
from surfaces import sphere

from ripple_sim.solver import Mesh, MeshError, build_atlas
from ripple_sim.solver.mesh.mesh import check_genus_zero, vertex_normals


def test_clean_mesh_comes_through_unchanged() -> None:
    V, F = cube()
    mesh = Mesh.from_arrays(V, F)
    np.testing.assert_array_equal(mesh.V, V)
    np.testing.assert_array_equal(mesh.F, F)
    assert mesh.notes == ()
    assert mesh.volume == pytest.approx(1)
    assert mesh.area == pytest.approx(6)


def test_uv_seams_survive_the_merge() -> None:
    V, F = cube()
    soup = V[F].reshape(-1, 3)
    uv = np.random.default_rng(0).uniform(size=(36, 2))
    mesh = Mesh.from_arrays(soup, np.arange(36).reshape(-1, 3)[:, ::-1], uv)
    assert mesh.corner_uv is not None and mesh.uv is not None
    for triangle, corners in zip(mesh.V[mesh.F], mesh.corner_uv, strict=True):
        for point, pair in zip(triangle, corners, strict=True):
            match = (soup == point).all(axis=1) & (uv == pair).all(axis=1)
            assert match.sum() == 1
    assert mesh.uv.shape == (8, 2)


def test_vertex_normals_of_a_sphere_are_radial() -> None:
    solid = trimesh.creation.icosphere(subdivisions=3)
    mesh = Mesh.from_arrays(solid.vertices, solid.faces)
    assert np.einsum("ij,ij->i", mesh.vertex_normals, mesh.V).min() > 0.999


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda V, F: (V, F[1:]), r"open: 3 boundary edges round 1 hole \(one near \(.*repair"),
        (lambda V, F: (V, F[:2]), "open: 4 boundary edges round 1 hole"),
        (lambda V, F: (np.vstack([V, V + 3]), np.vstack([F, F + 8])), "2 separate parts"),
        (lambda V, F: (np.vstack([V, [[5, 5, 5]]]), np.vstack([F, [[0, 1, 8]]])), "2 separate parts.*and open.*cut"),
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


def test_many_parts_are_advised_to_be_wrapped() -> None:
    V, F = cube()
    steps = np.arange(101)
    many = Mesh.from_arrays(
        (V + 3 * steps[:, None, None] * [1, 0, 0]).reshape(-1, 3), (F + 8 * steps[:, None, None]).reshape(-1, 3)
    )
    with pytest.raises(MeshError, match=r"101 separate parts.*--wrap"):
        check_genus_zero(many)


def test_a_closed_body_without_handles_passes() -> None:
    check_genus_zero(Mesh.from_arrays(*cube()))


def least_cosine(mesh: Mesh) -> float:
    a, b, c = mesh.V[mesh.F].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return float(np.einsum("mkj,mj->mk", mesh.vertex_normals[mesh.F], normal).min())


def test_normals_of_a_sphere_are_radial() -> None:
    ball = sphere(3)
    np.testing.assert_allclose(ball.vertex_normals, ball.V, atol=0.02)


def test_the_normal_of_a_spike_points_outwards_of_the_one_triangle_that_faces_elsewhere() -> None:
    # many narrow triangles face up, two wide ones down and to the side: their mean would point into those
    angle = np.concatenate([np.linspace(0, np.pi, 24), [1.5 * np.pi]])
    rim = np.stack([np.cos(angle), np.sin(angle), np.where(angle > np.pi, -6.0, -0.1)], axis=1)
    V = np.concatenate([[[0.0, 0.0, 0.0]], rim])
    F = np.array([[0, 1 + i, 1 + (i + 1) % 25] for i in range(25)])
    mesh = Mesh.from_arrays(V, F)
    assert least_cosine(mesh) > 0.1
    spun = vertex_normals(V[:, [1, 2, 0]], F)
    np.testing.assert_allclose(spun, mesh.vertex_normals[:, [1, 2, 0]], atol=1e-9)
