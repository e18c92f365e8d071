"""The atlas: every texel on the surface, locating points, saving and caching."""

import itertools
from pathlib import Path

import igl
import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Atlas, AtlasError, Mesh, SphereAtlas, build_atlas, load_atlas, sphere_atlas
from ripple_sim.solver.cube_map.convention import texel_directions
from ripple_sim.solver.cube_map.exhaustive_rays import cast_rays_exhaustively
from ripple_sim.solver.cube_map.rays import cast_rays
from ripple_sim.solver.texels.atlas_file import FORMAT


def surface_points(atlas: Atlas, triangles: np.ndarray, barycentrics: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijk->ik", barycentrics, atlas.mesh.V[atlas.mesh.F[triangles]])


def test_rays_agree_with_every_ray_against_every_triangle(animal: Atlas) -> None:
    directions = texel_directions(8).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh.F, directions)
    expected, weights = cast_rays_exhaustively(animal.sphere, animal.mesh.F, directions)
    assert weights.min() > -1e-12
    # a ray through an edge may count to either side; the point is the same
    differ = triangles != expected
    assert differ.mean() < 0.05
    assert np.abs(weights[differ].min(axis=1)).max(initial=0) < 1e-9
    np.testing.assert_allclose(barycentrics[~differ], weights[~differ], atol=1e-9)
    points, others = surface_points(animal, triangles, barycentrics), surface_points(animal, expected, weights)
    np.testing.assert_allclose(points, others, atol=1e-9)
    assert (barycentrics >= 0).all()
    np.testing.assert_allclose(barycentrics.sum(axis=1), 1)


def test_rays_that_walk_on_from_their_neighbours_hit_the_same(animal: Atlas) -> None:
    n = 48
    directions = texel_directions(n).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh.F, directions)
    for stride in (3, 16, len(directions)):
        walked, weights = cast_rays(animal.sphere, animal.mesh.F, directions, stride)
        inside = barycentrics.min(axis=1) > 0
        np.testing.assert_array_equal(walked[inside], triangles[inside])
        np.testing.assert_array_equal(weights[inside], barycentrics[inside])
        assert inside.mean() > 0.9
        points, others = surface_points(animal, walked, weights), surface_points(animal, triangles, barycentrics)
        np.testing.assert_allclose(points, others, atol=1e-12)


@pytest.mark.parametrize("what", ["cube edges and corners", "edges and vertices of the mesh", "anywhere"])
def test_rays_in_degenerate_directions_agree_too(what: str) -> None:
    coarse = trimesh.creation.icosphere(subdivisions=2)
    V, F = np.array(coarse.vertices), np.array(coarse.faces)
    if what == "cube edges and corners":
        directions = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
    elif what == "edges and vertices of the mesh":
        directions = np.concatenate([V, (V[F[:, 0]] + V[F[:, 1]]) / 2])
    else:
        directions = np.random.default_rng(0).standard_normal((200, 3))
    found, weights = cast_rays(V, F, directions)
    expected, expected_weights = cast_rays_exhaustively(V, F, directions)
    hit, other = (np.einsum("ij,ijk->ik", w, V[F[t]]) for t, w in ((found, weights), (expected, expected_weights)))
    np.testing.assert_allclose(hit, other, atol=1e-9)
    np.testing.assert_allclose(np.cross(hit, directions), 0, atol=1e-9)
    assert (np.einsum("ij,ij->i", hit, directions) > 0).all()


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
    np.savez(path, V=np.zeros((3, 3)), format=np.array([FORMAT]))
    with pytest.raises(AtlasError, match="not an atlas, or of another version"):
        load_atlas(path)


def test_files_of_another_version_are_refused(animal: Atlas, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    animal.save(tmp_path / "atlas.npz")
    monkeypatch.setattr("ripple_sim.solver.texels.atlas_file.FORMAT", FORMAT + 1)
    with pytest.raises(AtlasError, match="another version"):
        load_atlas(tmp_path / "atlas.npz")
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
