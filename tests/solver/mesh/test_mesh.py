"""Mesh loading: what is mended, what is refused, and by which name."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Mesh, MeshError, load_mesh

SHARED = Path(__file__).parents[4] / "shared" / "meshes"


def cube() -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box()
    return np.array(box.vertices), np.array(box.faces)


def torus() -> tuple[np.ndarray, np.ndarray]:
    solid = trimesh.creation.torus(1.0, 0.3)
    return np.array(solid.vertices), np.array(solid.faces)


def test_clean_mesh_comes_through_unchanged() -> None:
    V, F = cube()
    mesh = Mesh.from_arrays(V, F)
    np.testing.assert_array_equal(mesh.V, V)
    np.testing.assert_array_equal(mesh.F, F)
    assert mesh.fixes == ()
    assert mesh.volume == pytest.approx(1)
    assert mesh.area == pytest.approx(6)


def test_triangle_soup_is_merged() -> None:
    V, F = cube()
    mesh = Mesh.from_arrays(V[F].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert any("duplicate" in fix for fix in mesh.fixes)
    assert mesh.volume == pytest.approx(1)


def test_inward_and_mixed_winding_are_turned_outward() -> None:
    V, F = cube()
    assert Mesh.from_arrays(V, F[:, ::-1]).volume == pytest.approx(1)
    mixed = F.copy()
    mixed[[1, 4, 7]] = mixed[[1, 4, 7]][:, ::-1]
    mesh = Mesh.from_arrays(V, mixed)
    assert mesh.volume == pytest.approx(1)
    assert any("3 triangles reversed" in fix for fix in mesh.fixes)


def test_unused_vertices_and_collapsed_triangles_are_dropped() -> None:
    V, F = cube()
    V = np.vstack([[[9.0, 9.0, 9.0]], V])
    F = np.vstack([F + 1, [[1, 1, 2]], F[:1] + 1])
    mesh = Mesh.from_arrays(V, F)
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert len(mesh.fixes) == 3


def test_uv_seams_survive_the_merge() -> None:
    V, F = cube()
    soup = V[F].reshape(-1, 3)
    uv = np.random.default_rng(0).uniform(size=(36, 2))
    mesh = Mesh.from_arrays(soup, np.arange(36).reshape(-1, 3)[:, ::-1], uv)
    assert mesh.corner_uv is not None and mesh.uv is not None
    for face, corners in zip(mesh.V[mesh.F], mesh.corner_uv, strict=True):
        for point, pair in zip(face, corners, strict=True):
            match = (soup == point).all(axis=1) & (uv == pair).all(axis=1)
            assert match.sum() == 1
    assert mesh.uv.shape == (8, 2)


@pytest.mark.parametrize(
    ("damage", "name"),
    [
        (lambda V, F: (V, F[1:]), "open: 3 boundary edges"),
        (lambda V, F: (np.vstack([V, V + 3]), np.vstack([F, F + 8])), "2 separate parts"),
        (lambda V, F: (np.vstack([V, [[5, 5, 5]]]), np.vstack([F, [[0, 1, 8]]])), "non-manifold"),
        (lambda V, F: (np.where(np.arange(8)[:, None] == 2, np.nan, V), F), "NaN"),
        (lambda V, F: (V * [1, 1, 0], F), "."),
        (lambda V, F: (V, F + 1), "indices run from"),
        (lambda V, F: (V, F[:2]), "open: 4 boundary edges round 1 hole"),
        (lambda V, F: (V, F[:1]), "open: 3 boundary edges"),
        (lambda V, F: (V, F[:1, [0, 1, 1]]), "three different corners"),
        (lambda V, F: (V * 1e15, F), "size is 1e"),
        (lambda V, F: (V, F * 1.5), "integers"),
    ],
)
def test_defects_are_refused_by_name(damage, name: str) -> None:
    with pytest.raises(MeshError, match=name):
        Mesh.from_arrays(*damage(*cube()))


def test_genus_is_named() -> None:
    with pytest.raises(MeshError, match="genus 1"):
        Mesh.from_arrays(*torus())


def test_two_cubes_sharing_a_corner_are_non_manifold() -> None:
    V, F = cube()
    with pytest.raises(MeshError, match=r"separate parts|touches itself"):
        Mesh.from_arrays(np.vstack([V, V + 1]), np.vstack([F, F + 8]))


def test_files_of_every_format_give_the_same_surface(tmp_path: Path) -> None:
    solid = trimesh.creation.icosphere(subdivisions=2)
    for ending in ("obj", "ply", "stl", "off", "glb"):
        solid.export(tmp_path / f"ball.{ending}")
        mesh = load_mesh(tmp_path / f"ball.{ending}")
        assert (len(mesh.V), len(mesh.F)) == (162, 320), ending
        assert mesh.volume == pytest.approx(solid.volume, rel=1e-5)


def test_missing_and_broken_files_are_one_line_errors(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="does not exist"):
        load_mesh(tmp_path / "nothing.obj")
    broken = tmp_path / "broken.ply"
    broken.write_bytes(b"\x00\x01 not a mesh")
    with pytest.raises(MeshError) as error:
        load_mesh(broken)
    assert "\n" not in str(error.value)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the public test meshes are not here")
@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("genus1-rocker-arm.obj", "genus 1"),
        ("genus3-3holes.off", "genus 3"),
        ("nonmanifold-cow.obj", "non-manifold"),
        ("open-camelhead.off", "open"),
        ("several-parts-teapot.obj", "separate parts"),
    ],
)
def test_public_meshes_with_defects(file: str, name: str) -> None:
    with pytest.raises(MeshError, match=name):
        load_mesh(SHARED / "bad" / file)


def test_vertex_normals_of_a_sphere_are_radial() -> None:
    solid = trimesh.creation.icosphere(subdivisions=3)
    mesh = Mesh.from_arrays(solid.vertices, solid.faces)
    assert np.einsum("ij,ij->i", mesh.vertex_normals, mesh.V).min() > 0.999
