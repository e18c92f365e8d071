"""Normals of vertices: those of the surface, and outwards of every triangle at tips and knife edges too."""

import numpy as np
from surfaces import sphere

from ripple_sim.solver import Mesh
from ripple_sim.solver.mesh.mesh import vertex_normals


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
