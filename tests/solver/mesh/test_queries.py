"""Nearest points of triangles without area; rays from above meet the highest point of a mesh."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver.mesh import ClosestPoints, RayScene, downward_hits, rays


def test_closest_points_allow_degenerate_and_coincident_triangles() -> None:
    V = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    F = np.array([[0, 0, 0], [0, 1, 2], [1, 1, 2], *[[0, 1, 3]] * 9])
    points = np.array([[0.0, 0, 1], [1.5, -1, 0], [3, 0, 0], [0.2, 0.2, -2], [-1, 5, 0]])
    _, closest = ClosestPoints(V, F)(points)
    np.testing.assert_allclose(
        closest, [[0, 0, 0], [1.5, 0, 0], [2, 0, 0], [0.2, 0.2, 0], [0, 1, 0]], atol=1e-15
    )


def hits(solid: trimesh.Trimesh, xy: list) -> np.ndarray:
    V = np.array(solid.vertices)
    xy = np.array(xy, dtype=float).reshape(-1, 2)
    return downward_hits(RayScene(V, np.array(solid.faces)), xy, V[:, 2].max())[1]


def test_heights_on_a_slope_are_those_of_its_plane() -> None:
    V = np.array([[0.0, 0, 0], [4, 0, 2], [0, 4, -1]])
    xy = np.random.default_rng(0).dirichlet([1, 1, 1], 50) @ V[:, :2]
    for F in ([[0, 1, 2]], [[0, 2, 1]]):  # from behind too
        _, z = downward_hits(RayScene(V, np.array(F)), xy, 2.0)
        np.testing.assert_allclose(z, 0.5 * xy[:, 0] - 0.25 * xy[:, 1], atol=1e-5)


def test_a_vertical_ray_hits_the_upper_of_two_surfaces() -> None:
    low, high = (trimesh.creation.box(extents=[s, s, 1]) for s in (4, 2))
    high.apply_translation([0, 0, 5])
    ray = 0.5 + 5 + 4  # embree's float32 has steps of 1e-6 there
    expected = pytest.approx([5.5, 0.5], abs=float(np.spacing(np.float32(ray))))
    assert hits(low + high, [[0.3, 0.2], [1.5, 0.2]]) == expected


def test_rays_beside_the_mesh_give_no_number() -> None:
    z = hits(trimesh.creation.box(), [[0.1, 0.2], [0.6, 0], [0, -50]])
    assert z[0] == pytest.approx(0.5)
    assert np.isnan(z[1:]).all()
    assert hits(trimesh.creation.box(), []).shape == (0,)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("offset", [[0, 0, 0], [0, 0, -3], [2, -1, 7]])
def test_heights_follow_size_and_place_of_the_mesh(size: float, offset: list[float]) -> None:
    solid = trimesh.creation.box(extents=[1, 1, 1])
    solid.apply_translation(offset)
    solid.apply_scale(size)
    x, y, z = offset
    assert hits(solid, [[size * (x + 0.1), size * (y - 0.2)]]) == pytest.approx(
        [size * (z + 0.5)], rel=1e-5
    )


def test_rays_of_libigl_and_embree_hit_the_same_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("embreex")
    solid = trimesh.creation.annulus(0.4, 1.0, 0.5, sections=24)
    V, F = np.array(solid.vertices), np.array(solid.faces)
    random = np.random.default_rng(0)
    origins = random.normal(size=(500, 3))
    directions = 0.3 * random.normal(size=(500, 3)) - origins
    by_embree = RayScene(V, F)
    monkeypatch.setattr(rays, "EmbreeScene", None)  # as on Linux on ARM
    by_libigl = RayScene(V[F])
    expected = by_embree.cast(origins, directions)
    is_hit = expected[0] >= 0
    assert 100 < is_hit.sum() < 400
    for value, expected_value in zip(by_libigl.cast(origins, directions), expected, strict=True):
        assert value.dtype == expected_value.dtype
        np.testing.assert_allclose(value[is_hit], expected_value[is_hit], atol=2e-4)
    np.testing.assert_array_equal(by_libigl.cast(origins, directions)[0] >= 0, is_hit)
    assert np.isinf(by_libigl.distances(origins, directions)[~is_hit]).all()
