"""The atlas: every texel on the surface, locating points, saving and caching."""

from pathlib import Path

import igl
import numpy as np
import pytest

from ripple_sim.solver import Atlas, AtlasError, Mesh, SphereAtlas, build_atlas, load_atlas, sphere_atlas
from ripple_sim.solver.cubemap import texel_directions
from ripple_sim.solver.rays import cast_rays


def test_rays_find_the_triangle_that_a_search_over_all_finds(animal: Atlas) -> None:
    directions = texel_directions(12).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh.F, directions)
    a, b, c = (animal.sphere[animal.mesh.F[:, k]] for k in range(3))
    for i in range(0, len(directions), 7):
        d = directions[i]
        inside = (
            (np.einsum("ij,ij->i", np.cross(a, b), d[None]) >= 0)
            & (np.einsum("ij,ij->i", np.cross(b, c), d[None]) >= 0)
            & (np.einsum("ij,ij->i", np.cross(c, a), d[None]) >= 0)
        )
        assert inside[triangles[i]]
        hit = barycentrics[i] @ animal.sphere[animal.mesh.F[triangles[i]]]
        np.testing.assert_allclose(np.cross(hit, d), 0, atol=1e-12)
    assert (barycentrics >= 0).all()
    np.testing.assert_allclose(barycentrics.sum(axis=1), 1)


def test_every_texel_lies_on_the_surface(animal: Atlas) -> None:
    mesh = animal.mesh
    points = np.einsum("fijk,fijkl->fijl", animal.barycentrics, mesh.V[mesh.F[animal.triangles]])
    np.testing.assert_allclose(points, animal.positions, atol=1e-14)
    squared, _, _ = igl.point_mesh_squared_distance(animal.positions.reshape(-1, 3), mesh.V, mesh.F)
    assert np.sqrt(squared.max()) < 1e-12
    np.testing.assert_allclose(np.linalg.norm(animal.normals, axis=-1), 1)


def test_locate_returns_the_texel_that_a_point_was_taken_from(animal: Atlas) -> None:
    n = animal.resolution
    face, row, column = (x.reshape(6, n, n) for x in animal.locate(animal.positions.reshape(-1, 3)))
    assert (face == np.arange(6)[:, None, None]).all()
    np.testing.assert_allclose(row, np.broadcast_to(np.arange(n)[:, None], (6, n, n)), atol=1e-6)
    np.testing.assert_allclose(column, np.broadcast_to(np.arange(n), (6, n, n)), atol=1e-6)


def test_quality_of_a_limbed_atlas(animal: Atlas) -> None:
    quality = animal.quality()
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi, abs=1e-9)
    assert quality["starved"] == 0
    assert quality["q999"] < 4
    assert quality["coverage"] == pytest.approx(1, abs=0.02)
    assert animal.areas.sum() == pytest.approx(quality["coverage"] * animal.mesh.area)
    assert 0 < quality["edge_min"] < quality["edge_max"]


def test_sphere_atlas_is_exact() -> None:
    atlas = sphere_atlas(2.5, 24)
    np.testing.assert_allclose(np.linalg.norm(atlas.positions, axis=-1), 2.5, rtol=1e-15)
    assert atlas.radius == pytest.approx(2.5)
    mesh = Mesh.from_arrays(atlas.mesh.V, atlas.mesh.F)
    assert mesh.fixes == ()
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 2.5**3, rel=0.01)
    points, directions = atlas.project([[0, 0, 9.0], [1, 1, 1]])
    np.testing.assert_allclose(points[0], [0, 0, 2.5])
    np.testing.assert_allclose(directions[1], np.ones(3) / np.sqrt(3))


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
    with pytest.raises(AtlasError, match="does not exist"):
        load_atlas(tmp_path / "missing.npz")


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
    file.write_bytes(file.read_bytes()[:500])
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
