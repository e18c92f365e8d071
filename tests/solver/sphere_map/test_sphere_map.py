"""The sphere map is a certified bijection that spreads area, on every shape of genus 0."""

from pathlib import Path

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ripple_sim.solver.errors import SphereMapError
from ripple_sim.solver.sphere_map import (
    certify,
    conformal_sphere_map,
    progressive,
    progressive_sphere_map,
    stretch,
    stretch_quantiles,
)

MESHES = Path(__file__).resolve().parents[4] / "shared" / "meshes" / "good"

TETRAHEDRON = (
    np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


def icosphere(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def solid(mesh):
    return np.array(mesh.vertices), np.array(mesh.faces)


def bipyramid(sides):
    angle = 2 * np.pi / sides * np.arange(sides)
    V = np.vstack([np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), [[0, 0, 1], [0, 0, -1]]])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    top, bottom = np.full(sides, sides), np.full(sides, sides + 1)
    return V, np.vstack([np.stack([i, j, top], axis=1), np.stack([j, i, bottom], axis=1)])


def stretched(factors, subdivisions=3):
    V, F = icosphere(subdivisions)
    return V * factors, F


def spiky(height, seed=0):
    V, F = icosphere(3)
    V[np.random.default_rng(seed).choice(len(V), 12, replace=False)] *= height
    return V, F


def crumpled(seed=0):
    V, F = icosphere(3)
    return V + 0.2 * np.random.default_rng(seed).standard_normal(V.shape), F


def jack(limb_radius=0.12, limb_length=1.7, points=48):
    """Six thin limbs along the axes, from a signed distance."""
    axis = np.linspace(-2, 2, points)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    P = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    distance = np.full(len(P), np.inf)
    for k in range(3):
        nearest = np.zeros_like(P)
        nearest[:, k] = np.clip(P[:, k], -limb_length, limb_length)
        distance = np.minimum(distance, np.linalg.norm(P - nearest, axis=1) - limb_radius)
    V, F = igl.marching_cubes(distance, P, points, points, points, 0.0)[:2]
    if np.einsum("ij,ij->", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]])) < 0:
        F = F[:, ::-1]
    return V, np.ascontiguousarray(F)


SHAPES = {
    "tetrahedron": lambda: TETRAHEDRON,
    "octahedron": lambda: bipyramid(4),
    "cube of 12 triangles": lambda: solid(trimesh.creation.box()),
    "flat slab": lambda: solid(trimesh.creation.box(extents=[1, 1, 0.01])),
    "vertex of degree 500": lambda: bipyramid(500),
    "sphere": lambda: icosphere(3),
    "cigar 100:1": lambda: stretched([1, 1, 100]),
    "pancake 100:1": lambda: stretched([100, 100, 1]),
    "cylinder of slivers": lambda: solid(trimesh.creation.cylinder(radius=1, height=50, sections=100)),
    "spikes of 100 radii": lambda: spiky(100),
    "one needle": lambda: (lambda V, F: (np.vstack([V[:1] * 1000, V[1:]]), F))(*icosphere(2)),
    "crumpled, self-intersecting": crumpled,
    "six limbs": jack,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_map_is_certified(shape):
    V, F = SHAPES[shape]()
    S = progressive_sphere_map(V, F)
    certificate = certify(F, S)
    assert certificate.valid
    assert certificate.flipped == 0
    assert certificate.solid_angle == pytest.approx(4 * np.pi, abs=1e-9)
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-12)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    subdivisions=st.integers(0, 3),
    roughness=st.floats(0, 1.5),
    factors=st.tuples(*[st.floats(0.02, 1)] * 3),
)
def test_every_star_shaped_bumpy_mesh_maps_without_folds(seed, subdivisions, roughness, factors):
    V, F = icosphere(subdivisions)
    radius = np.exp(roughness * np.random.default_rng(seed).standard_normal(len(V)))
    S = progressive_sphere_map(V * radius[:, None] * np.array(factors), F)
    assert certify(F, S).valid


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


def test_no_map_without_a_certificate(monkeypatch):
    V, F = icosphere(1)
    monkeypatch.setattr(progressive, "_map_by_levels", lambda V, F, trust: np.ones_like(V) / np.sqrt(3))
    with pytest.raises(SphereMapError, match=f"{len(F)} of {len(F)} triangles"):
        progressive_sphere_map(V, F)


@pytest.mark.parametrize("trust", progressive.TRUST_LADDER)
def test_every_rung_of_the_ladder_can_hold_a_limbed_mesh(trust):
    V, F = jack(points=30, limb_radius=0.2)
    assert certify(F, progressive._map_by_levels(progressive._normalise(V, F), F, trust)).valid


def test_next_rung_is_tried_where_one_folds(monkeypatch):
    V, F = icosphere(1)
    tried = []

    def fold_at_first(V, F, trust):
        tried.append(trust)
        S = V / np.linalg.norm(V, axis=1, keepdims=True)
        return S if len(tried) == 3 else -S

    monkeypatch.setattr(progressive, "_map_by_levels", fold_at_first)
    monkeypatch.setattr(progressive, "align", lambda V, F, S: S)
    np.testing.assert_allclose(progressive_sphere_map(V, F), V, atol=1e-8)
    assert tried == list(progressive.TRUST_LADDER[:3])


def test_same_mesh_gives_same_bits():
    V, F = jack(points=30, limb_radius=0.3)
    np.testing.assert_array_equal(progressive_sphere_map(V, F), progressive_sphere_map(V, F))


def test_scale_and_place_of_the_mesh_do_not_matter():
    V, F = crumpled()  # no symmetry, so no ties for round-off to break
    S = progressive_sphere_map(V, F)
    np.testing.assert_allclose(progressive_sphere_map(1000 * V, F), S, atol=1e-6)
    np.testing.assert_allclose(progressive_sphere_map(1e-4 * V, F), S, atol=1e-6)
    np.testing.assert_allclose(progressive_sphere_map(V + np.array([5, -2, 1]), F), S, atol=1e-6)


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


def test_round_sphere_is_spread_evenly():
    V, F = icosphere(4)
    low, _, median, _, high = stretch_quantiles(V, F, progressive_sphere_map(V, F))
    assert 0.97 < low <= median <= high < 1.03


def test_limbs_get_their_share_of_the_sphere():
    V, F = jack()
    quantiles = stretch_quantiles(V, F, progressive_sphere_map(V, F), [0.5, 0.99, 0.999])
    assert np.all(quantiles < [1.5, 2.2, 2.3])


@pytest.mark.parametrize(("name", "bound"), [("spot.obj", 1.9), ("bunny.off", 2.0), ("elephant.obj", 2.0)])
def test_known_mesh(name, bound):
    path = MESHES / name
    if not path.exists():
        pytest.skip("the mesh is not part of the project")
    mesh = trimesh.load(path, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    V, F = solid(mesh)
    S = progressive_sphere_map(V, F)
    assert certify(F, S).valid
    assert stretch_quantiles(V, F, S, [0.999])[0] < bound


def bumpy_sphere():
    V, F = icosphere(4)
    return V * (1 + 0.2 * np.prod(np.sin(3 * V), axis=1, keepdims=True) + 0.3 * V[:, :1] ** 2), F


def angles(P, F):
    corners = []
    for j in range(3):
        u, v = P[F[:, (j + 1) % 3]] - P[F[:, j]], P[F[:, (j + 2) % 3]] - P[F[:, j]]
        cosine = np.einsum("ij,ij->i", u, v) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
        corners.append(np.degrees(np.arccos(cosine)))
    return np.stack(corners, axis=1)


def test_conformal_map_keeps_angles_everywhere():
    V, F = bumpy_sphere()
    S = conformal_sphere_map(V, F)
    assert certify(F, S).valid
    error = np.abs(angles(S, F) - angles(V, F))
    assert np.median(error) < 0.5
    # the harmonic map alone is wrong by tens of degrees round the triangle that was cut out
    assert error.max() < 5
    assert np.median(np.abs(angles(progressive_sphere_map(V, F), F) - angles(V, F))) > 2 * np.median(error)


def test_conformal_map_of_a_sphere_is_a_moebius_map():
    V, F = icosphere(3)
    S = conformal_sphere_map(V, F)
    # Moebius maps keep cross-ratios of chords
    a, b, c, d = np.random.default_rng(0).choice(len(V), (4, 200))

    def chord(P, start, end):
        return np.linalg.norm(P[start] - P[end], axis=1)

    distinct = np.min([chord(V, a, b), chord(V, c, d), chord(V, a, c), chord(V, b, d)], axis=0) > 0.3
    ratio = [chord(P, a, b) * chord(P, c, d) / (chord(P, a, c) * chord(P, b, d)) for P in (V, S)]
    np.testing.assert_allclose(ratio[1][distinct], ratio[0][distinct], rtol=0.05)


@pytest.mark.parametrize("shape", ["crumpled, self-intersecting", "one needle", "spikes of 100 radii"])
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
