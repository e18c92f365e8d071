"""Atlases of the patch layout: every texel on the surface, areas, rims, several parts."""

import numpy as np
import pytest
from known_meshes import known_mesh
from surfaces import disk, joined, moved, sphere, square, torus

from ripple_sim.solver import Atlas, AtlasError, Material, Mesh, WaveSolver, build_atlas, load_atlas, load_mesh

MESHES = {
    "sphere": lambda: sphere(3),
    "torus": lambda: torus(24),
    "square": lambda: square(6),
    "disk": lambda: disk(12),
    "one triangle": lambda: Mesh.from_arrays(np.eye(3), [[0, 1, 2]]),
    "two parts": lambda: joined(sphere(2), moved(disk(8), (3, 0, 0), 0.5)),
}


@pytest.fixture(scope="module", params=MESHES)
def atlas(request: pytest.FixtureRequest) -> Atlas:
    return build_atlas(MESHES[request.param](), 24, cache=False, layout="patches")


def test_texels_lie_in_their_triangles(atlas: Atlas) -> None:
    corners = atlas.mesh.V[atlas.mesh.F[atlas.triangles]]
    points = np.einsum("...k,...kj->...j", atlas.barycentrics, corners)
    np.testing.assert_allclose(points, atlas.positions, atol=1e-12)
    assert atlas.barycentrics.min() > -1e-6
    np.testing.assert_allclose(atlas.barycentrics.sum(axis=-1), 1.0, atol=1e-9)


def test_no_triangle_is_folded_and_every_texel_is_found_where_it_lies(atlas: Atlas) -> None:
    assert atlas.quality()["flipped"] == 0
    np.testing.assert_array_equal(atlas.nearest_texel(atlas.positions.reshape(-1, 3)), np.arange(atlas.areas.size))
    chart, row, column = atlas.locate(atlas.positions.reshape(-1, 3))
    place = np.stack([chart, row, column]).reshape(3, *atlas.areas.shape)
    np.testing.assert_allclose(place, np.indices(atlas.areas.shape), atol=1e-5)


def test_the_areas_add_up_to_the_surface(atlas: Atlas) -> None:
    assert atlas.quality()["coverage"] == pytest.approx(1.0, abs=0.01)
    assert (atlas.areas > 0).all()


def test_neighbours_across_a_border_of_charts_are_neighbours_on_the_surface(atlas: Atlas) -> None:
    quality = atlas.quality()
    assert quality["edge_max"] < 4 * np.sqrt(atlas.areas.max())


def test_what_lies_beyond_a_rim_lies_on_it(atlas: Atlas) -> None:
    topology = atlas.texels.topology
    if not topology.rim.any():
        assert atlas.mesh.closed
        return
    points = atlas.texels.beyond[topology.rim]
    ends = atlas.mesh.V[np.concatenate([np.stack([rim, np.roll(rim, -1)], axis=1) for rim in atlas.mesh.rims])]
    along = ends[:, 1] - ends[:, 0]
    share = np.einsum("pek,ek->pe", points[:, None] - ends[:, 0], along) / (along**2).sum(axis=1)
    nearest = ends[:, 0] + np.clip(share, 0, 1)[..., None] * along
    assert np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1).max() < 1e-9


def test_a_wave_keeps_its_energy(atlas: Atlas) -> None:
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.add_impulse(atlas.positions[0, 1, 1], 1e-3, 0.3)
    before = waves.energy()
    waves.step(0.5, substeps=400)
    assert waves.energy() == pytest.approx(before, rel=1e-3)


def test_texture_coordinates_cover_every_triangle_once(atlas: Atlas) -> None:
    pieces = atlas.texture_coordinates()
    share = np.abs(np.linalg.det(pieces.barycentrics))
    np.testing.assert_allclose(np.bincount(pieces.triangle, share, len(atlas.mesh.F)), 1.0, atol=1e-6)
    u, v = np.moveaxis(pieces.uv[:, 1:] - pieces.uv[:, :1], 1, 0)
    flat = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    np.testing.assert_allclose(np.bincount(pieces.chart, flat, len(atlas.areas)), 1.0, atol=1e-6)


def test_parts_share_the_texels_by_area() -> None:
    mesh = joined(sphere(2), moved(sphere(2), (3, 0, 0), 0.7))
    atlas = build_atlas(mesh, 32, cache=False, layout="patches")
    small = mesh.components[atlas.triangles] == 1
    assert small.mean() == pytest.approx(0.7**2 / (1 + 0.7**2), abs=0.08)
    # no chart holds texels of both
    assert (small.all(axis=(1, 2)) | ~small.any(axis=(1, 2))).all()


def test_auto_takes_the_cube_where_it_fits() -> None:
    assert build_atlas(sphere(2), 8, cache=False).layout == "cube"
    assert build_atlas(torus(12), 8, cache=False).layout == "patches"


def test_unknown_layouts_are_refused() -> None:
    with pytest.raises(AtlasError, match="valid are 'auto', 'cube', 'patches'"):
        build_atlas(sphere(1), 8, layout="hexagons")


def test_saved_and_read_again_it_is_the_same(tmp_path) -> None:
    atlas = build_atlas(disk(8), 16, cache=False)
    atlas.save(tmp_path / "disk.npz")
    again = load_atlas(tmp_path / "disk.npz")
    assert again.layout == "patches"
    np.testing.assert_array_equal(again.positions, atlas.positions)
    np.testing.assert_array_equal(again.texels.beyond, atlas.texels.beyond)
    points = atlas.positions[:, 2, 1]
    for one, other in zip(again.locate(points), atlas.locate(points), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_same_mesh_gives_the_same_atlas() -> None:
    one, other = (build_atlas(torus(12), 16, cache=False) for _ in range(2))
    np.testing.assert_array_equal(one.positions, other.positions)
    np.testing.assert_array_equal(one.areas, other.areas)


@pytest.mark.parametrize("name", ["several-parts-teapot.obj", "genus3-3holes.off", "genus1-rocker-arm.obj"])
def test_known_meshes_that_no_cube_fits_carry_waves(name: str) -> None:
    atlas = build_atlas(load_mesh(known_mesh(f"bad/{name}")), 32, cache=False)
    assert atlas.quality()["flipped"] == 0
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.add_impulse(atlas.positions[3, 2, 2], 1e-6, 0.0)
    waves.step(10 * waves.stable_timestep)
    assert np.isfinite(waves.height).all() and waves.height.any()
