"""The certificate sees every fold; stretch by area; the best turn of the cube."""

import numpy as np
import pytest
import trimesh
from genus_zero import icosphere, thin_limb
from scipy.spatial.transform import Rotation

from ripple_sim.solver import Mesh, WaveSolver, build_atlas
from ripple_sim.solver.layouts import atlas_from_sphere_map
from ripple_sim.solver.layouts.sphere_map import (
    certificate,
    certify,
    progressive_sphere_map,
    stretch,
)


def test_certificate_catches_a_planted_fold():
    V, F = icosphere(3)
    assert certify(F, V).valid
    S = V.copy()
    star = F[np.any(F == 7, axis=1)]
    outer = star[star != 7]
    across = 2 * S[outer[0]] - S[7]  # beyond its own star
    S[7] = across / np.linalg.norm(across)
    certificate = certify(F, S)
    assert certificate.flipped > 0
    assert not certificate.valid


def test_the_certificate_refuses_maps_that_cover_twice_or_inside_out():
    V, F = icosphere(2)
    assert certify(F, -V).flipped == len(F)
    assert certify(F, -V).solid_angle == pytest.approx(-4 * np.pi)
    # (theta, phi) -> (theta, 2 phi): every triangle away from the poles keeps its orientation
    doubled = np.stack([V[:, 0] ** 2 - V[:, 1] ** 2, 2 * V[:, 0] * V[:, 1], V[:, 2]], axis=1)
    doubled[:, :2] /= np.maximum(np.hypot(V[:, 0], V[:, 1]), 1e-12)[:, None]
    assert not certify(F, doubled).valid


def test_certificate_catches_vertices_off_the_sphere_and_nan():
    V, F = icosphere(1)
    assert not certify(F, 1.1 * V).valid
    V[3] = np.nan
    assert not certify(F, V).valid


def test_stretch_is_one_for_the_identity_and_doubles_with_lengths():
    V, F = icosphere(4)
    np.testing.assert_allclose(stretch(V, F, V), 1, rtol=5e-3)
    below = V[F][:, :, 2].max(axis=1) < 0
    lopsided = stretch(np.where(V[:, 2:] > 0, 1.0, 2.0) * V, F, V)
    above = V[F][:, :, 2].min(axis=1) > 0
    assert np.median(lopsided[below]) / np.median(lopsided[above]) == pytest.approx(2, rel=0.01)


def test_turning_the_cube_lengthens_the_time_step():
    V, F = thin_limb(3, 0.3)
    V = V / np.sqrt(trimesh.Trimesh(V, F, process=False).area / (4 * np.pi))
    mesh = Mesh.from_arrays(V, F)
    S = progressive_sphere_map(V, F)

    def step(sphere_map):
        return WaveSolver(
            atlas_from_sphere_map(mesh, sphere_map, 32), backend="cpu"
        ).stable_timestep

    others = [step(S @ rotation.T) for rotation in Rotation.random(12, random_state=1).as_matrix()]
    assert step(S) > np.median(others)
    # wherever the map starts from
    again = certificate.align(V, F, S @ Rotation.random(random_state=7).as_matrix().T)
    assert step(again) > np.median(others)


def test_built_atlas_uses_the_turned_map():
    V, F = thin_limb(2, 0.4)
    mesh = Mesh.from_arrays(V, F)
    atlas = build_atlas(mesh, 8, cache=False, layout="cube")
    np.testing.assert_array_equal(atlas.sphere, progressive_sphere_map(mesh.V, mesh.F))
