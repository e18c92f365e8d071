"""The certificate sees every fold; stretch is measured by area.

Turning the map so that the cube lies well on it.
"""

import numpy as np
import pytest
import trimesh
from genus_zero import icosphere
from limbs import sphere, thin_limb
from scipy.spatial.transform import Rotation

from ripple_sim.solver import Mesh, WaveSolver, build_atlas
from ripple_sim.solver.layouts.build import atlas_from_sphere_map
from ripple_sim.solver.layouts.sphere_map import (
    certificate,
    certify,
    progressive_sphere_map,
    stretch,
    stretch_quantiles,
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


def test_certificate_catches_what_covers_the_sphere_twice_or_inside_out():
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


def test_stretch_quantiles_are_weighted_by_area():
    V, F = icosphere(4)
    V = np.where(V[:, 2:] > 0, 1.0, 3.0) * V  # nine tenths of the area are below
    values = stretch_quantiles(V, F, icosphere(4)[0], [0.05, 0.2, 0.5])
    assert values[1] / values[0] > 2
    assert values[2] == pytest.approx(values[1], rel=0.05)


def test_candidate_rotations_are_rotations_and_leave_no_gap():
    rotations = certificate.spread_rotations(2000)
    np.testing.assert_allclose(
        rotations @ rotations.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (2000, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1)
    anywhere = Rotation.random(100, random_state=0).as_matrix()
    trace = np.einsum("aij,bij->ab", anywhere, rotations).max(axis=1)
    assert np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1))).max() < 25


def test_turning_the_cube_lengthens_the_time_step():
    V, F = thin_limb(3, 0.3)
    V = V / np.sqrt(trimesh.Trimesh(V, F, process=False).area / (4 * np.pi))
    mesh, S = Mesh.from_arrays(V, F), progressive_sphere_map(V, F)

    def step(sphere_map):
        return WaveSolver(atlas_from_sphere_map(mesh, sphere_map, 32), backend="cpu").stable_timestep

    others = [step(S @ rotation.T) for rotation in Rotation.random(12, random_state=1).as_matrix()]
    assert step(S) > np.median(others)
    # wherever the map starts from
    again = certificate.align(V, F, S @ Rotation.random(random_state=7).as_matrix().T)
    assert step(again) > np.median(others)


def test_narrow_texels_are_found_where_they_are():
    """On the round sphere the narrowest texel is pi/4 cos(45 deg) of two, in every alignment."""
    V, F = sphere(5)
    metric, area = certificate._vertex_metrics(F.astype(np.int32), V, V)
    np.testing.assert_allclose(area.sum(), 4 * np.pi, rtol=0.01)
    one = np.array([1.0])
    for direction, width in (([0, 0, 1], 1), ([0, 1, 1], np.sqrt(0.5)), ([1, 0, 1], np.sqrt(0.5))):
        p = np.array([direction]) / np.linalg.norm(direction)
        tangent = np.eye(3) - p.T @ p
        pure = np.array([[*np.diag(tangent), tangent[0, 1], tangent[0, 2], tangent[1, 2]]])
        found = certificate._narrowness(np.eye(3), p, pure, one, np.inf) ** (-1 / (2 * certificate.SHARPNESS))
        assert found == pytest.approx(width)
    nearest = np.argmax(V @ [0.6, 0, 0.8])
    tangent = np.eye(3) - np.outer(V[nearest], V[nearest])
    np.testing.assert_allclose(metric[nearest, :3], np.diag(tangent), atol=0.02)


def test_built_atlas_uses_the_turned_map():
    V, F = thin_limb(2, 0.4)
    mesh = Mesh.from_arrays(V, F)
    np.testing.assert_array_equal(build_atlas(mesh, 8, cache=False).sphere, progressive_sphere_map(mesh.V, mesh.F))
