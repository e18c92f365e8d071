"""The progressive map is a certified bijection that spreads area, on every shape of genus 0."""

from typing import NamedTuple

import numpy as np
import pytest
import trimesh
from genus_zero import SHAPES, crumpled, icosphere, jack, solid, stretch_quantiles, thin_limb
from hypothesis import HealthCheck, given, settings, strategies as st
from known_meshes import known_mesh
from levels import whole_level
from scipy.spatial.transform import Rotation

from ripple_sim.solver import Mesh, WaveSolver
from ripple_sim.solver.errors import SphereMapError
from ripple_sim.solver.layouts import atlas_from_sphere_map
from ripple_sim.solver.layouts.sphere_map import (
    certify,
    newton_step,
    progressive,
    progressive_sphere_map,
    relax_level,
    total_energy,
)


@pytest.mark.parametrize("shape", SHAPES)
def test_map_is_certified(shape):
    V, F = SHAPES[shape]()
    S = progressive_sphere_map(V, F)
    certificate = certify(F, S)
    assert certificate.valid
    assert certificate.flipped == 0
    assert certificate.solid_angle == pytest.approx(4 * np.pi, abs=1e-9)
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-12)


def test_no_map_without_a_certificate(monkeypatch):
    V, F = icosphere(1)
    monkeypatch.setattr(
        progressive, "_map_by_levels", lambda V, F, trust: np.ones_like(V) / np.sqrt(3)
    )
    with pytest.raises(SphereMapError, match=f"{len(F)} of {len(F)} triangles"):
        progressive_sphere_map(V, F)


@pytest.mark.parametrize("trust", progressive.TRUST_LADDER)
def test_every_rung_of_the_ladder_can_hold_a_limbed_mesh(trust, monkeypatch):
    V, F = jack(points=30, limb_radius=0.2)
    monkeypatch.setattr(progressive, "TRUST_LADDER", (trust,))
    assert certify(F, progressive_sphere_map(V, F)).valid


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


def test_round_sphere_is_spread_evenly():
    V, F = icosphere(4)
    low, _, median, _, high = stretch_quantiles(V, F, progressive_sphere_map(V, F))
    assert 0.97 < low <= median <= high < 1.03


def test_limbs_get_their_share_of_the_sphere():
    V, F = jack()
    quantiles = stretch_quantiles(V, F, progressive_sphere_map(V, F), [0.5, 0.99, 0.999])
    assert np.all(quantiles < [1.5, 2.2, 2.3])


@pytest.mark.parametrize(
    ("name", "bound"), [("spot.obj", 1.9), ("bunny.off", 2.0), ("elephant.obj", 2.0)]
)
def test_known_meshes_have_certified_maps_of_bounded_stretch(name, bound):
    mesh = trimesh.load(known_mesh(f"good/{name}"), process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    V, F = solid(mesh)
    S = progressive_sphere_map(V, F)
    assert certify(F, S).valid
    assert stretch_quantiles(V, F, S, [0.999])[0] < bound


SEEDS = st.integers(0, 2**32 - 1)
EXAMPLES = settings(
    max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)


def smooth_radius(V, rng, roughness, waves=5):
    """A positive radius in every direction, smooth over about a third of the sphere."""
    directions = rng.standard_normal((waves, 3)) * 2
    phases = rng.uniform(0, 2 * np.pi, waves)
    return np.exp(roughness * np.mean(np.sin(V @ directions.T + phases), axis=1))


def split_edges(V, F, rng, share, slenderness):
    """Put a vertex close to a side of some triangles, which makes two slivers of each."""
    chosen = np.flatnonzero(rng.random(len(F)) < share)
    weights = np.array([(1 - slenderness) / 2, (1 - slenderness) / 2, slenderness])
    middle = np.einsum("j,ijk->ik", weights, V[F[chosen]])
    new = len(V) + np.arange(len(chosen))
    a, b, c = F[chosen].T
    kept = np.delete(F, chosen, axis=0)
    parts = [np.stack(t, axis=1) for t in ((a, b, new), (b, c, new), (c, a, new))]
    return np.vstack([V, middle]), np.vstack([kept, *parts])


def assert_certified(V, F):
    S = progressive_sphere_map(V, F)
    assert certify(F, S).valid
    return S


@EXAMPLES
@given(seed=SEEDS, points=st.integers(4, 400), factors=st.tuples(*[st.floats(0.05, 1)] * 3))
def test_convex_hulls_of_random_points_get_certified_maps(seed, points, factors):
    hull = trimesh.convex.convex_hull(
        np.random.default_rng(seed).standard_normal((points, 3)) * factors
    )
    assert_certified(*solid(hull))


@EXAMPLES
@given(seed=SEEDS, roughness=st.floats(0, 3))
def test_smooth_star_shapes_are_never_starved(seed, roughness):
    V, F = icosphere(3)
    V = V * smooth_radius(V, np.random.default_rng(seed), roughness)[:, None]
    S = assert_certified(V, F)
    assert stretch_quantiles(V, F, S, [0.999])[0] < 2.2


@EXAMPLES
@given(seed=SEEDS, share=st.floats(0.05, 1), slenderness=st.sampled_from([1e-1, 1e-3, 1e-6]))
def test_slivers_starve_nothing(seed, share, slenderness):
    rng = np.random.default_rng(seed)
    V, F = icosphere(3)
    V = V * smooth_radius(V, rng, 1)[:, None]
    V, F = split_edges(V, F, rng, share, slenderness)
    S = assert_certified(V, F)
    assert stretch_quantiles(V, F, S, [0.999])[0] < 4


@EXAMPLES
@given(length=st.floats(1, 20), radius=st.floats(0.05, 0.6))
def test_thin_limbs_keep_their_texels(length, radius):
    V, F = thin_limb(length, radius)
    S = assert_certified(V, F)
    assert stretch_quantiles(V, F, S, [0.999])[0] < 4


@EXAMPLES
@given(seed=SEEDS, power=st.floats(0, 4))
def test_very_uneven_triangles_get_an_even_map(seed, power):
    """A mesh with triangles a hundred times smaller on one side gets an even map."""
    V, F = icosphere(4)
    pole = np.random.default_rng(seed).standard_normal(3)
    pole /= np.linalg.norm(pole)
    # a Moebius map of the sphere crowds the vertices round one pole
    V = V + np.tanh(power / 2) * 0.98 * pole
    inside = np.sum(V * V, axis=1, keepdims=True)
    V = V / np.sqrt(inside)
    S = assert_certified(V, F)
    low, high = stretch_quantiles(V, F, S, [0.01, 0.99])
    assert 0.8 < low < high < 1.25


def limbed():
    V, F = thin_limb(3, 0.3)
    return V * smooth_radius(V, np.random.default_rng(3), 1)[:, None], F


class Figures(NamedTuple):
    """Quality of a mesh's sphere map: stretch at 1, 50, 99 and 99.9 % of the area; stable step."""

    stretch: np.ndarray
    step: float  # over the root of the area, at wave speed 1


def figures(V, F):
    S = progressive_sphere_map(V, F)
    assert certify(F, S).valid
    atlas = atlas_from_sphere_map(Mesh.from_arrays(V, F), S, 32)
    step = WaveSolver(atlas, backend="cpu").stable_timestep / np.sqrt(atlas.mesh.area)
    return Figures(stretch_quantiles(V, F, S, [0.01, 0.5, 0.99, 0.999]), step)


@pytest.fixture(scope="module")
def limbed_figures():
    return figures(*limbed())


def rotated(V, F):
    return V @ Rotation.random(random_state=0).as_matrix().T, F


def renumbered(V, F):
    rng = np.random.default_rng(0)
    order = rng.permutation(len(V))
    number = np.empty(len(V), dtype=int)
    number[order] = np.arange(len(V))
    F = np.array(
        [np.roll(f, k) for f, k in zip(number[F], rng.integers(0, 3, len(F)), strict=True)]
    )
    return V[order], rng.permutation(F)


@pytest.mark.parametrize(
    "change",
    [rotated, renumbered, lambda V, F: (1e-5 * V, F), lambda V, F: (1e4 * V, F)],
    ids=["turn", "order", "small", "large"],
)
def test_a_mesh_turned_scaled_or_renumbered_has_an_atlas_as_good(change, limbed_figures):
    found = figures(*change(*limbed()))
    np.testing.assert_allclose(found.stretch, limbed_figures.stretch, rtol=0.02)
    # the narrowest of a few thousand texels decides the time step, and it is another one each time
    assert found.step == pytest.approx(limbed_figures.step, rel=0.25)


def perturbed(V):
    S = V + 0.03 * np.random.default_rng(2).standard_normal(V.shape)
    return S / np.linalg.norm(S, axis=1)[:, None]


def squeezed(V):
    """A conformal map that draws the sphere towards its north pole."""
    x, y, z = V.T
    factor = 0.2 * np.sqrt((1 - z) / (1 + z).clip(1e-12))  # tan of half the new polar angle
    bottom = z < -1 + 1e-9
    t = np.where(bottom, 1e6, factor)
    planar = np.stack([x, y], axis=1) / np.hypot(x, y).clip(1e-12)[:, None]
    return np.column_stack([planar * (2 * t / (1 + t * t))[:, None], (1 - t * t) / (1 + t * t)])


@pytest.mark.parametrize("start", [perturbed, squeezed])
def test_a_sphere_comes_back_to_its_own_shape(start):
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    S = start(V)
    least = total_energy(level.tail, V, reference)
    assert certify(F, S).valid and total_energy(level.tail, S, reference) > 1.05 * least
    relax_level(level, S, reference)
    assert total_energy(level.tail, S, reference) < 1.01 * least
    assert certify(F, S).valid
    np.testing.assert_allclose(S @ S.T, V @ V.T, atol=0.1)  # the same but for a rotation


def test_relaxing_again_gains_next_to_nothing():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    energies = [total_energy(level.tail, S, reference)]
    for _ in range(2):
        relax_level(level, S, reference)
        energies.append(total_energy(level.tail, S, reference))
    assert energies[1] < 0.5 * energies[0]
    assert 0.9 * energies[1] < energies[2] <= energies[1]
    assert certify(F, S).valid
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-12)


def test_a_folded_map_is_left_as_it_is():
    V, F = icosphere(1)
    level, reference = whole_level(V, F)
    S = -V
    relax_level(level, S, reference)
    np.testing.assert_array_equal(S, -V)


def test_newton_steps_reach_the_minimum_of_a_perturbed_sphere():
    V, F = icosphere(3)
    level, reference = whole_level(V, F)
    S = V + 0.015 * np.random.default_rng(2).standard_normal(V.shape)
    S /= np.linalg.norm(S, axis=1)[:, None]
    least = total_energy(level.tail, V, reference)
    assert total_energy(level.tail, S, reference) > 1.05 * least
    for _ in range(8):
        newton_step(level, S, reference, 60)
    assert total_energy(level.tail, S, reference) < (1 + 1e-4) * least
