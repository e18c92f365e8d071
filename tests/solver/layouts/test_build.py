"""Atlases are built, saved, loaded and cached; texels lie on the surface."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
from genus_zero import icosphere
from hypothesis import HealthCheck, given, settings, strategies as st
from surfaces import disk

from ripple_sim.solver import Atlas, AtlasError, Mesh, SphereAtlas, SphereMapError, sphere_atlas
from ripple_sim.solver.layouts import build_atlas, load_atlas


@pytest.fixture(scope="module")
def ball_mesh() -> Mesh:
    return Mesh.from_arrays(*icosphere(2))


def test_cache_is_used_verified_and_rebuilt(
    ball_mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = build_atlas(ball_mesh, 8)
    assert "sphere_map" in first.timings
    again = build_atlas(ball_mesh, 8)
    assert "cache" in again.timings
    np.testing.assert_array_equal(first.positions, again.positions)
    finer = build_atlas(ball_mesh, 12)
    np.testing.assert_array_equal(finer.sphere, first.sphere)
    [file] = (tmp_path / "ripple-sim").iterdir()
    whole = file.read_bytes()
    build_atlas(Mesh(2 * ball_mesh.V, ball_mesh.F), 8)
    [other] = set((tmp_path / "ripple-sim").iterdir()) - {file}
    middle = len(whole) // 2
    for spoilt in (
        whole[:500],
        whole[:middle] + bytes([whole[middle] ^ 16]) + whole[middle + 1 :],
        other.read_bytes(),
    ):
        file.write_bytes(spoilt)
        rebuilt = build_atlas(ball_mesh, 8)
        assert "cache" not in rebuilt.timings
        np.testing.assert_array_equal(first.positions, rebuilt.positions)
        assert "cache" in build_atlas(ball_mesh, 8).timings


def test_unwritable_cache_only_costs_time(
    ball_mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ripple-sim").write_text("a file where the folder should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert build_atlas(ball_mesh, 8).resolution == 8


def test_unknown_method_lists_the_valid_ones(ball_mesh: Mesh) -> None:
    with pytest.raises(AtlasError, match="'progressive'"):
        build_atlas(ball_mesh, 8, method="mercator")


def test_a_known_sphere_map_is_taken_and_has_a_file_of_its_own(
    ball_mesh: Mesh, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    known = ball_mesh.V / np.linalg.norm(ball_mesh.V, axis=1, keepdims=True)
    first, again = (build_atlas(ball_mesh, 8, sphere=known) for _ in range(2))
    assert "cache" in again.timings
    for atlas in (first, again):
        np.testing.assert_array_equal(atlas.sphere, known)
    assert "cache" not in build_atlas(ball_mesh, 8).timings


@pytest.mark.parametrize(
    "change", [lambda S: -S, lambda S: S[:-1], lambda S: 2 * S, lambda S: np.nan * S]
)
def test_a_sphere_map_of_something_else_is_refused(change, ball_mesh: Mesh) -> None:
    known = ball_mesh.V / np.linalg.norm(ball_mesh.V, axis=1, keepdims=True)
    with pytest.raises(SphereMapError, match="no fold-free sphere map of the mesh"):
        build_atlas(ball_mesh, 8, cache=False, sphere=change(known))


@pytest.mark.parametrize("layout", ["cube", "patches"])
def test_an_atlas_is_unchanged_after_saving_and_loading(
    animal: Atlas, tmp_path: Path, layout: str
) -> None:
    if layout == "patches":
        animal = build_atlas(disk(8), 16, cache=False)
    animal.save(tmp_path / "deep" / "animal.npz")
    loaded = load_atlas(tmp_path / "deep" / "animal.npz")
    assert loaded.layout == layout
    for name in (
        "positions",
        "normals",
        "triangles",
        "barycentrics",
        *(["sphere"] if layout == "cube" else []),
    ):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(animal, name))
    np.testing.assert_array_equal(loaded.texels.beyond, animal.texels.beyond)
    np.testing.assert_array_equal(loaded.locate(animal.mesh.V), animal.locate(animal.mesh.V))
    sphere_atlas(3.0, 8).save(tmp_path / "sphere.npz")
    assert isinstance(load_atlas(tmp_path / "sphere.npz"), SphereAtlas)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deep", "sphere.npz"]


SEEDS = st.integers(0, 2**32 - 1)
EXAMPLES = settings(
    max_examples=5, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)


def revolved(height: np.ndarray, radius: np.ndarray, around: int) -> tuple[np.ndarray, np.ndarray]:
    """Surface of revolution about z with `around` sides and a vertex at each end."""
    n = len(height)
    angle = 2 * np.pi / around * np.arange(around)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    side = radius[:, None, None] * ring + height[:, None, None] * [0, 0, 1]
    V = np.vstack(
        [
            side.reshape(-1, 3),
            [[0, 0, 2 * height[0] - height[1]], [0, 0, 2 * height[-1] - height[-2]]],
        ]
    )
    i = np.arange(around)
    j = np.roll(np.arange(around), -1)
    bottom = np.full(around, n * around)
    top = np.full(around, n * around + 1)
    first = np.stack([i, j, around + j, around + i], axis=1)
    quads = np.concatenate([first + k for k in range(0, (n - 1) * around, around)])
    caps = [
        np.stack([bottom, j, i], axis=1),
        np.stack([top, (n - 1) * around + i, (n - 1) * around + j], axis=1),
    ]
    return V, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], *caps])


def sound_atlas(V: np.ndarray, F: np.ndarray, starved: float = 0.0) -> Atlas:
    """Build the atlas of a mesh and assert that nothing is wrong with it."""
    mesh = Mesh.from_arrays(V, F)
    atlas = build_atlas(mesh, 12, cache=False, layout="cube")
    quality = atlas.quality()
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi, abs=1e-9)
    assert quality["starved"] <= starved
    assert 0 <= atlas.triangles.min() <= atlas.triangles.max() < len(mesh.F)
    assert (atlas.barycentrics >= 0).all()
    np.testing.assert_allclose(atlas.barycentrics.sum(axis=-1), 1, rtol=1e-12)
    points = np.einsum("fijk,fijkl->fijl", atlas.barycentrics, mesh.V[mesh.F[atlas.triangles]])
    np.testing.assert_allclose(
        atlas.positions, points, rtol=1e-12, atol=1e-12 * np.abs(mesh.V).max()
    )
    np.testing.assert_allclose(np.linalg.norm(atlas.normals, axis=-1), 1, rtol=1e-9)
    return atlas


@EXAMPLES
@given(seed=SEEDS, spikes=st.integers(1, 30), longest=st.floats(1, 300))
def test_stars_with_spikes_get_a_sound_atlas(seed: int, spikes: int, longest: float) -> None:
    V, F = icosphere(3)
    rng = np.random.default_rng(seed)
    V[rng.choice(len(V), spikes, replace=False)] *= longest ** rng.random((spikes, 1))
    sound_atlas(V, F, starved=0.01)


@EXAMPLES
@given(seed=SEEDS, blobs=st.integers(2, 7), neck=st.floats(0.02, 0.5), around=st.integers(5, 20))
def test_chains_of_blobs_get_a_sound_atlas(seed: int, blobs: int, neck: float, around: int) -> None:
    rng = np.random.default_rng(seed)
    place = np.linspace(0, blobs, 16 * blobs + 1)
    size = np.interp(place, np.arange(blobs + 1), rng.uniform(0.4, 1, blobs + 1))
    sound_atlas(
        *revolved(2 * place, size * (neck + (1 - neck) * np.abs(np.sin(np.pi * place))), around)
    )


def test_a_hard_shape_gives_the_same_bits_again() -> None:
    V, F = icosphere(3)
    V[::40] *= 50
    first, second = (sound_atlas(V, F) for _ in range(2))
    for name in ("sphere", "positions", "normals", "triangles", "barycentrics"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_long_computations_of_charts_are_logged(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    build = sys.modules[build_atlas.__module__]
    monkeypatch.setattr(build, "_MESSAGE_INTERVAL", 0.01)
    with build._progress_messages(Mesh.from_arrays(*icosphere(2))) as report:
        report("cutting")
        time.sleep(0.2)
    begin = "laying charts on a mesh of 320 triangles in 1 part:"
    assert f"{begin} cutting, 0 s so far" in caplog.messages[-1]
    logged = len(caplog.messages)
    time.sleep(0.1)
    assert len(caplog.messages) == logged  # no more once the charts are laid


def test_thin_plate_gets_patches_since_texels_of_the_cube_are_folded() -> None:
    plate = trimesh.creation.box((1.0, 1.0, 0.001))
    mesh = Mesh.from_arrays(plate.vertices, plate.faces)
    cube = build_atlas(mesh, 16, cache=False, layout="cube")
    chosen = build_atlas(mesh, 16, cache=False)
    assert chosen.layout == "patches"
    assert chosen.quality()["folded"] < cube.quality()["folded"]
    assert "of the cube would be folded" in chosen.notes[0]


def test_both_sides_of_a_sheet_without_thickness_face_out() -> None:
    """Every vertex belongs to both sides, so that normals of vertices lie in the sheet."""
    V = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    F = np.array([[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]])
    atlas = build_atlas(Mesh.from_arrays(V, F), 16, cache=False, layout="patches")
    up = np.array([1.0, 1.0, -1.0, -1.0])[atlas.triangles]
    np.testing.assert_allclose(atlas.normals[..., 2], up, atol=1e-12)
