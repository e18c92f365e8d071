"""The conformal map keeps angles, and refuses rather than fold."""

import numpy as np
import pytest
from genus_zero import SHAPES, crumpled, icosphere

from ripple_sim.solver.errors import SphereMapError
from ripple_sim.solver.layouts.sphere_map import (
    certify,
    conformal_sphere_map,
    progressive_sphere_map,
)


def angles(P, F):
    corners = []
    for j in range(3):
        u = P[F[:, (j + 1) % 3]] - P[F[:, j]]
        v = P[F[:, (j + 2) % 3]] - P[F[:, j]]
        cosine = np.einsum("ij,ij->i", u, v) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
        corners.append(np.degrees(np.arccos(cosine)))
    return np.stack(corners, axis=1)


def test_conformal_map_keeps_angles_everywhere():
    V, F = icosphere(4)
    V = V * (1 + 0.2 * np.prod(np.sin(3 * V), axis=1, keepdims=True) + 0.3 * V[:, :1] ** 2)
    S = conformal_sphere_map(V, F)
    assert certify(F, S).valid
    error = np.abs(angles(S, F) - angles(V, F))
    assert np.median(error) < 0.5
    # the harmonic map alone is wrong by tens of degrees round the triangle that was cut out
    assert error.max() < 5
    assert np.median(
        np.abs(angles(progressive_sphere_map(V, F), F) - angles(V, F))
    ) > 2 * np.median(error)


def test_conformal_map_of_a_sphere_is_a_moebius_map():
    V, F = icosphere(3)
    S = conformal_sphere_map(V, F)
    # Moebius maps keep cross-ratios of chords
    a, b, c, d = np.random.default_rng(0).choice(len(V), (4, 200))

    def chord(P, start, end):
        return np.linalg.norm(P[start] - P[end], axis=1)

    distinct = (
        np.min([chord(V, a, b), chord(V, c, d), chord(V, a, c), chord(V, b, d)], axis=0) > 0.3
    )
    ratio = [chord(P, a, b) * chord(P, c, d) / (chord(P, a, c) * chord(P, b, d)) for P in (V, S)]
    np.testing.assert_allclose(ratio[1][distinct], ratio[0][distinct], rtol=0.05)


@pytest.mark.parametrize(
    "shape", ["crumpled, self-intersecting", "one needle", "spikes of 100 radii"]
)
def test_conformal_map_refuses_rather_than_fold(shape):
    V, F = SHAPES[shape]()
    try:
        S = conformal_sphere_map(V, F)
    except SphereMapError as error:
        assert "progressive" in str(error)
    else:
        assert certify(F, S).valid


def test_conformal_map_names_the_folds():
    V, F = crumpled()
    with pytest.raises(SphereMapError, match=r"folds \d+ of 1280 triangles"):
        conformal_sphere_map(V, F)
