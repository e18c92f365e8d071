"""The certificate sees every fold; stretch is measured by area."""

import numpy as np
import pytest
from genus_zero import icosphere

from ripple_sim.solver.layouts.sphere_map import certify, stretch, stretch_quantiles


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
