"""Meshes: validated, measured, and refused by name."""

import numpy as np
import pytest
import trimesh
from solids import cube

from ripple_sim.solver import Mesh


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
