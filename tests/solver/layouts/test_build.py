"""The atlas: every texel on the surface, locating points, saving and caching.

Atlases on disk: saved, loaded, refused.
"""

from __future__ import annotations

from pathlib import Path

import igl
import numpy as np
import pytest

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import (
    Atlas,
    AtlasError,
    Mesh,
    SphereAtlas,
    SphereMapError,
    build_atlas,
    load_atlas,
    sphere_atlas,
)
from ripple_sim.solver.texels.atlas import FORMAT


def test_every_texel_lies_on_the_surface(animal: Atlas) -> None:
    mesh = animal.mesh
    points = np.einsum("fijk,fijkl->fijl", animal.barycentrics, mesh.V[mesh.F[animal.triangles]])
    np.testing.assert_allclose(points, animal.positions, atol=1e-14)
    squared, _, _ = igl.point_mesh_squared_distance(animal.positions.reshape(-1, 3), mesh.V, mesh.F)
    assert np.sqrt(squared.max()) < 1e-12
    np.testing.assert_allclose(np.linalg.norm(animal.normals, axis=-1), 1)


def test_cache_is_used_verified_and_rebuilt(ball_mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    for spoilt in (whole[:500], whole[:middle] + bytes([whole[middle] ^ 16]) + whole[middle + 1 :], other.read_bytes()):
        file.write_bytes(spoilt)
        rebuilt = build_atlas(ball_mesh, 8)
        assert "cache" not in rebuilt.timings
        np.testing.assert_array_equal(first.positions, rebuilt.positions)
        assert "cache" in build_atlas(ball_mesh, 8).timings


def test_unwritable_cache_only_costs_time(ball_mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ripple-sim").write_text("a file where the folder should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert build_atlas(ball_mesh, 8).resolution == 8


def test_unknown_method_lists_the_valid_ones(ball_mesh: Mesh) -> None:
    with pytest.raises(AtlasError, match="'progressive'"):
        build_atlas(ball_mesh, 8, method="mercator")


def test_a_known_sphere_map_is_taken_and_has_a_file_of_its_own(ball_mesh: Mesh, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    known = ball_mesh.V / np.linalg.norm(ball_mesh.V, axis=1, keepdims=True)
    first, again = (build_atlas(ball_mesh, 8, sphere=known) for _ in range(2))
    assert "cache" in again.timings
    for atlas in (first, again):
        np.testing.assert_array_equal(atlas.sphere, known)
    assert "cache" not in build_atlas(ball_mesh, 8).timings


@pytest.mark.parametrize("change", [lambda S: -S, lambda S: S[:-1], lambda S: 2 * S, lambda S: np.nan * S])
def test_a_sphere_map_of_something_else_is_refused(change, ball_mesh: Mesh) -> None:
    known = ball_mesh.V / np.linalg.norm(ball_mesh.V, axis=1, keepdims=True)
    with pytest.raises(SphereMapError, match="no fold-free sphere map of the mesh"):
        build_atlas(ball_mesh, 8, cache=False, sphere=change(known))


def with_degenerate_triangles(V: np.ndarray, F: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Split edges at a point on one of them, so that the triangles beyond get a corner on their own side: no area."""
    V, F = list(V), [list(f) for f in F]
    rng = np.random.default_rng(4)
    for k in rng.choice(len(F), count, replace=False):
        a, b, c = F[k]
        V.append((1 - 1e-3) * V[a] + 1e-3 * V[b])  # on the edge a-b: the triangle a, new, b has no area
        new = len(V) - 1
        F[k] = [new, b, c]
        F += [[a, new, c], [a, b, new]]
    return np.array(V), np.array(F)


def test_triangles_without_area_and_slivers_get_an_atlas() -> None:
    V, F = with_degenerate_triangles(*limbed(), count=40)
    mesh = Mesh.from_arrays(V, F)
    assert mesh.triangle_areas.min() > 0, "those without area are left out"
    assert mesh.closed and mesh.genus.tolist() == [0]
    atlas = build_atlas(mesh, 32, cache=False)
    quality = atlas.quality()
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi)
    assert quality["coverage"] == pytest.approx(1, abs=0.05)
    assert np.isfinite(atlas.positions).all()
    assert np.isfinite(atlas.normals).all()
    assert np.isfinite(np.concatenate(atlas.locate(mesh.V))).all()


def test_save_and_load(animal: Atlas, tmp_path: Path) -> None:
    animal.save(tmp_path / "deep" / "animal.npz")
    loaded = load_atlas(tmp_path / "deep" / "animal.npz")
    for name in ("positions", "normals", "triangles", "barycentrics", "sphere"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(animal, name))
    sphere_atlas(3.0, 8).save(tmp_path / "sphere.npz")
    assert isinstance(load_atlas(tmp_path / "sphere.npz"), SphereAtlas)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["deep", "sphere.npz"]


def test_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "atlas.npz"
    sphere_atlas(1.0, 8).save(path)
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole[:3000] + b"\x00" * 50 + whole[3050:], b"PK\x03\x04 nonsense"):
        path.write_bytes(damaged)
        with pytest.raises(AtlasError, match="make it again"):
            load_atlas(path)
    np.savez(path, V=np.zeros((3, 3)), format=np.array([FORMAT]))
    with pytest.raises(AtlasError, match="not an atlas, or of another version"):
        load_atlas(path)


def test_files_of_another_version_are_refused(animal: Atlas, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    animal.save(tmp_path / "atlas.npz")
    monkeypatch.setattr("ripple_sim.solver.texels.atlas.FORMAT", FORMAT + 1)
    with pytest.raises(AtlasError, match="another version"):
        load_atlas(tmp_path / "atlas.npz")
    with pytest.raises(AtlasError, match="does not exist"):
        load_atlas(tmp_path / "missing.npz")
