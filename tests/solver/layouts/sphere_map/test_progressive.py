"""The progressive map is a certified bijection that spreads area, on every shape of genus 0."""

import numpy as np
import pytest
import trimesh
from genus_zero import SHAPES, crumpled, icosphere, jack, solid
from hypothesis import given, settings
from hypothesis import strategies as st
from known_meshes import known_mesh

from ripple_sim.solver.errors import SphereMapError
from ripple_sim.solver.layouts.sphere_map import certify, progressive, progressive_sphere_map, stretch_quantiles


@pytest.mark.parametrize("shape", SHAPES)
def test_map_is_certified(shape):
    V, F = SHAPES[shape]()
    S = progressive_sphere_map(V, F)
    certificate = certify(F, S)
    assert certificate.valid
    assert certificate.flipped == 0
    assert certificate.solid_angle == pytest.approx(4 * np.pi, abs=1e-9)
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-12)


@settings(max_examples=15, deadline=None, derandomize=True)
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
    mesh = trimesh.load(known_mesh(f"good/{name}"), process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    V, F = solid(mesh)
    S = progressive_sphere_map(V, F)
    assert certify(F, S).valid
    assert stretch_quantiles(V, F, S, [0.999])[0] < bound
