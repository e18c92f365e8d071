"""Atlases of hard shapes: spikes, chains of blobs, thin plates, needles; never a fold, never a lost texel."""

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ripple_sim.solver import Atlas, Mesh, build_atlas

SEEDS = st.integers(0, 2**32 - 1)
EXAMPLES = settings(max_examples=5, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


def sphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    ball = trimesh.creation.icosphere(subdivisions)
    return np.array(ball.vertices), np.array(ball.faces)


def revolved(height: np.ndarray, radius: np.ndarray, around: int) -> tuple[np.ndarray, np.ndarray]:
    """Surface of revolution about the z axis with `around` sides, closed by a vertex at both ends."""
    n = len(height)
    angle = 2 * np.pi / around * np.arange(around)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    side = radius[:, None, None] * ring + height[:, None, None] * [0, 0, 1]
    V = np.vstack([side.reshape(-1, 3), [[0, 0, 2 * height[0] - height[1]], [0, 0, 2 * height[-1] - height[-2]]]])
    i, j = np.arange(around), np.roll(np.arange(around), -1)
    bottom, top = np.full(around, n * around), np.full(around, n * around + 1)
    quads = [
        np.stack([k + i, k + j, k + around + j, k + around + i], axis=1) for k in range(0, (n - 1) * around, around)
    ]
    quads = np.concatenate(quads)
    caps = [np.stack([bottom, j, i], axis=1), np.stack([top, (n - 1) * around + i, (n - 1) * around + j], axis=1)]
    return V, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], *caps])


def sound_atlas(V: np.ndarray, F: np.ndarray, starved: float = 0.0) -> Atlas:
    """Build the atlas of a mesh and assert that nothing is wrong with it."""
    mesh = Mesh.from_arrays(V, F)
    atlas = build_atlas(mesh, 12, cache=False)
    quality = atlas.quality()
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi, abs=1e-9)
    assert quality["starved"] <= starved
    assert 0 <= atlas.triangles.min() <= atlas.triangles.max() < len(mesh.F)
    assert (atlas.barycentrics >= 0).all()
    np.testing.assert_allclose(atlas.barycentrics.sum(axis=-1), 1, rtol=1e-12)
    points = np.einsum("fijk,fijkl->fijl", atlas.barycentrics, mesh.V[mesh.F[atlas.triangles]])
    np.testing.assert_allclose(atlas.positions, points, rtol=1e-12, atol=1e-12 * np.abs(mesh.V).max())
    np.testing.assert_allclose(np.linalg.norm(atlas.normals, axis=-1), 1, rtol=1e-9)
    return atlas


@EXAMPLES
@given(seed=SEEDS, spikes=st.integers(1, 30), longest=st.floats(1, 300))
def test_stars_with_spikes(seed: int, spikes: int, longest: float) -> None:
    V, F = sphere(3)
    rng = np.random.default_rng(seed)
    V[rng.choice(len(V), spikes, replace=False)] *= longest ** rng.random((spikes, 1))
    sound_atlas(V, F, starved=0.01)


@EXAMPLES
@given(seed=SEEDS, blobs=st.integers(2, 7), neck=st.floats(0.02, 0.5), around=st.integers(5, 20))
def test_chains_of_blobs(seed: int, blobs: int, neck: float, around: int) -> None:
    rng = np.random.default_rng(seed)
    place = np.linspace(0, blobs, 16 * blobs + 1)
    size = np.interp(place, np.arange(blobs + 1), rng.uniform(0.4, 1, blobs + 1))
    sound_atlas(*revolved(2 * place, size * (neck + (1 - neck) * np.abs(np.sin(np.pi * place))), around))


@EXAMPLES
@given(thickness=st.floats(1e-6, 0.1), width=st.floats(0.1, 1), subdivisions=st.integers(0, 4))
def test_thin_plates(thickness: float, width: float, subdivisions: int) -> None:
    plate = trimesh.creation.box([1, width, thickness])
    for _ in range(subdivisions):
        plate = plate.subdivide()
    sound_atlas(np.array(plate.vertices), np.array(plate.faces))


@EXAMPLES
@given(slenderness=st.floats(10, 1000), around=st.integers(3, 16), rings=st.integers(2, 60))
def test_needles(slenderness: float, around: int, rings: int) -> None:
    height = np.linspace(-1, 1, rings + 2)[1:-1]
    sound_atlas(*revolved(slenderness * height, np.sqrt(1 - height**2), around))


def test_a_hard_shape_gives_the_same_bits_again() -> None:
    V, F = sphere(3)
    V[::40] *= 50
    first, second = (sound_atlas(V, F) for _ in range(2))
    for name in ("sphere", "positions", "normals", "triangles", "barycentrics"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
