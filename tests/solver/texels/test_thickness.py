"""Thickness of solids and layers, and medial radii, against closed forms."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from ripple_sim import RippleWarning
from ripple_sim.scenes.shapes import polygonise, sphere
from ripple_sim.solver import (
    Atlas,
    AtlasError,
    Mesh,
    MeshError,
    Volume,
    build_atlas,
    sphere_atlas,
    thickness_map,
)
from ripple_sim.solver.texels import MIN_MEDIAL_RADIUS, half_thickness, medial_radius


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_half_thickness_and_medial_radius_of_a_sphere_are_its_radius(radius: float) -> None:
    atlas = sphere_atlas(radius, 16)
    np.testing.assert_allclose(half_thickness(atlas), radius, rtol=0.01)
    np.testing.assert_allclose(medial_radius(atlas), radius, rtol=2e-3)


def test_the_medial_radius_of_a_slab_is_half_its_thickness() -> None:
    solid = trimesh.creation.box(extents=(1, 1, 0.2)).subdivide_to_size(0.1)
    atlas = build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 32, cache=False)
    flat = np.abs(atlas.normals[..., 2]) > 0.99
    away = flat & (np.abs(atlas.positions[..., :2]) < 0.4).all(axis=-1)
    np.testing.assert_allclose(half_thickness(atlas)[away], 0.1, rtol=0.02)
    np.testing.assert_allclose(half_thickness(atlas)[flat], 0.1, atol=0.05)


RADIUS = 0.6
BOUNDS = ((-0.8, -0.8, -0.8), (0.8, 0.8, 0.8))


def ball(centre: tuple[float, float, float], radius: float = RADIUS) -> Mesh:
    return Mesh.from_arrays(*polygonise(sphere(centre, radius), BOUNDS, 0.025))


def exact(points: np.ndarray, centre: tuple[float, float, float]) -> np.ndarray:
    """Way from points of the unit sphere inwards to a ball, infinite beside it."""
    to = np.array(centre) - points
    along = -(to * points).sum(axis=-1)
    under = RADIUS**2 - (to**2).sum(axis=-1) + along**2
    return np.where(under > 0, along - np.sqrt(np.maximum(under, 0)), np.inf)


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (0.1, -0.05, 0.15)])
def test_thickness_over_a_sphere_is_exact(centre: tuple[float, float, float]) -> None:
    atlas = sphere_atlas(1.0, 32)
    error = np.abs(thickness_map(atlas, ball(centre)) / exact(atlas.positions, centre) - 1)
    assert np.median(error) < 0.01
    assert np.quantile(error, 0.99) < 0.03


def test_voxels_with_noise_give_the_same_within_a_voxel() -> None:
    atlas = sphere_atlas(1.0, 32)
    centre = (0.1, -0.05, 0.15)
    voxel = 0.05
    nodes = np.arange(-0.8, 0.8 + voxel / 2, voxel)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1)
    depth = RADIUS - np.linalg.norm(grid - centre, axis=-1)
    # bone has 1000 and the rest 40, with the blur of a scanner and its noise
    values = (
        40
        + 960 / (1 + np.exp(-4 * depth / voxel))
        + np.random.default_rng(0).normal(0, 20, depth.shape)
    )
    volume = Volume(values, threshold=520.0, spacing=voxel, origin=(-0.8, -0.8, -0.8))
    assert np.abs(thickness_map(atlas, volume) - thickness_map(atlas, ball(centre))).max() < voxel


def test_the_thickness_over_several_bodies_is_to_the_nearest_one() -> None:
    atlas = sphere_atlas(1.0, 16)
    both = thickness_map(atlas, [ball((0, 0, 0), 0.3), ball((0, 0, 0))])
    np.testing.assert_allclose(both, thickness_map(atlas, ball((0, 0, 0))))


def test_rays_that_miss_get_the_greatest_thickness_and_a_warning() -> None:
    atlas = sphere_atlas(1.0, 48)
    centre = (0.0, 0.0, 0.35)
    small = ball(centre, 0.2)
    with pytest.warns(RippleWarning, match="have no inner body below them") as told:
        thickness = thickness_map(atlas, small)
    assert told[0].filename == __file__
    below = atlas.positions[..., 2] < -0.5
    assert thickness[atlas.positions[..., 2] > 0.998] == pytest.approx(0.45, abs=0.02)
    # rays from below go on through the middle to the ball, the longest of them is what others get
    assert thickness[below].min() > 1.0
    assert thickness.max() < 1.4


def test_an_inner_body_that_reaches_out_leaves_no_layer() -> None:
    atlas = sphere_atlas(1.0, 32)
    large = Mesh.from_arrays(
        *polygonise(sphere((0.0, 0.0, 0.6), 0.6), ((-0.8, -0.8, -0.2), (0.8, 0.8, 1.4)), 0.05)
    )
    with pytest.warns(RippleWarning, match="reaches out of the surface") as told:
        thickness = thickness_map(atlas, large)
    assert told[0].filename == __file__
    assert np.median(thickness[atlas.positions[..., 2] > 0.95]) < 1e-3


def test_bodies_that_are_not_inside_and_volumes_without_one_are_refused() -> None:
    atlas = sphere_atlas(1.0, 8)
    with pytest.raises(AtlasError, match="no ray from the surface"):
        thickness_map(atlas, [])
    far = ball((0, 0, 0), 0.2)
    with pytest.raises(AtlasError, match="no ray from the surface"):
        thickness_map(atlas, Mesh.from_arrays(far.V + 9.0, far.F))
    with pytest.raises(MeshError, match=r"threshold must lie between .*, got 2"):
        thickness_map(atlas, Volume(np.random.default_rng(0).random((4, 4, 4)), threshold=2.0))
    with pytest.raises(MeshError, match=r"shape \(4, 4\)"):
        Volume(np.zeros((4, 4)), threshold=0.5).surface()


def test_the_medial_radius_of_a_tube_is_the_tubes_radius_away_from_its_ends() -> None:
    solid = trimesh.creation.capsule(height=0.8, radius=0.1, count=(48, 48))
    atlas = build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 32, cache=False)
    middle = np.abs(atlas.positions[..., 2] - solid.centroid[2]) < 0.3
    assert middle.sum() > 500
    np.testing.assert_allclose(medial_radius(atlas)[middle], 0.1, rtol=0.1)


def test_points_moved_by_less_stay_nearest_to_where_they_came_from(animal: Atlas) -> None:
    size = np.ptp(animal.mesh.V, axis=0).max()
    points = animal.positions.reshape(-1, 3)
    normals = animal.normals.reshape(-1, 3)
    radius = medial_radius(animal).reshape(-1)
    assert radius.min() >= MIN_MEDIAL_RADIUS * size * (1 - 1e-12)
    tree = cKDTree(points)
    for side in (-1.0, 1.0):
        moved = points + side * 0.6 * radius[:, None] * normals
        _, nearest = tree.query(moved)
        # but for details smaller than those that count
        assert np.linalg.norm(points[nearest] - points, axis=1).max() < 3 * MIN_MEDIAL_RADIUS * size
