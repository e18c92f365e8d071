"""Contacts are the corners of a patch; force and torque stay the same on the patch."""

import numpy as np
import pytest

from ripple_sim.coupling import Footprints, corners, load_points
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas
from ripple_sim.solver.waves.footprint import footprint

SQUARE = 0.1 * np.array([[-1, -1, 5], [1, -1, 5], [-1, 1, 5], [1, 1, 5]])


def spread_patch(atlas: Atlas, points: np.ndarray, forces: np.ndarray, radius: float, convex: bool):
    patch = np.zeros(1, int), np.array([radius]), np.array([convex])
    patches, at, shares, radii = load_points(
        points, forces, *patch, lambda probes: atlas.nearest(probes)[0]
    )
    assert not patches.any()
    assert np.ptp(radii) == 0
    return at, shares, radii[0]


def test_four_equal_corners_spread_evenly_over_the_square(block: Atlas) -> None:
    points, forces, radius = spread_patch(block, SQUARE, np.full(4, 2.5), 0.01, convex=True)
    # nodes of a 3 x 3 lattice, each with the area that it stands for: 1 at a corner, 2 at a rim, 4
    # in the middle
    assert sorted(np.round(forces / 10 * 16)) == [1, 1, 1, 1, 2, 2, 2, 2, 4]
    assert np.abs(points[:, :2]).max() < 0.1
    assert radius > 0.05


@pytest.mark.parametrize("seed", range(4))
def test_force_and_torque_are_preserved(block: Atlas, seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.column_stack([rng.uniform(-0.3, 0.3, (6, 2)), np.full(6, 0.5)])
    loads = rng.uniform(0.1, 3.0, 6)
    points, forces, _ = spread_patch(block, corners, loads, 0.01, convex=True)
    assert len(forces) > 6
    assert forces.sum() == pytest.approx(loads.sum(), rel=1e-12)
    np.testing.assert_allclose(forces @ points, loads @ corners, atol=1e-12)


def test_distant_contacts_do_not_load_the_surface_between_them() -> None:
    """Two contacts, on the head and the rump, load these two and not the saddle between them."""
    V, F = limbed(0.05)
    animal = build_atlas(Mesh.from_arrays(V, F), 16, cache=False)
    head = V[V[:, 2].argmax()]
    rump = V[V[:, 0].argmin()]
    loads = np.array([2.0, 1.0])
    points, forces, radius = spread_patch(animal, np.array([head, rump]), loads, 0.02, convex=True)
    np.testing.assert_array_equal(points, [head, rump])
    np.testing.assert_allclose(forces, loads)
    assert radius == 0.02


def test_geoms_that_are_not_convex_load_the_surface_at_their_contacts(block: Atlas) -> None:
    points, _, radius = spread_patch(block, SQUARE, np.ones(4), 0.01, convex=False)
    assert (len(points), radius) == (4, 0.01)


def test_far_contacts_of_one_pair_stay_apart_and_add_up() -> None:
    points = np.array([[0, 0, 0], [0.01, 0, 0], [1.0, 0, 0]])
    forces = np.array([1.0, 3.0, 2.0])
    _, middles, totals = corners(np.zeros(3, int), points, forces, np.array([0.05]))
    np.testing.assert_allclose(totals, [4.0, 2.0])
    np.testing.assert_allclose(middles, [[0.0075, 0, 0], [1, 0, 0]])


@pytest.mark.parametrize("seed", range(6))
def test_patches_do_not_depend_on_one_another(block: Atlas, seed: int) -> None:
    """Four geoms on a cube: one has a single contact, and one is not convex."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 6, 4)
    counts[rng.integers(4)] = 1
    starts = np.cumsum([0, *counts[:-1]])
    size = counts.sum()
    points = np.column_stack([rng.uniform(-0.4, 0.4, (size, 2)), rng.uniform(0.5, 0.501, size)])
    forces = rng.uniform(0.1, 3.0, size)
    radii = np.array([0.04, 0.06, 0.03, 0.05])
    convex = np.array([True, False, True, True])
    patches, *together = load_points(
        points, forces, starts, radii, convex, lambda probes: block.nearest(probes)[0]
    )
    assert (np.diff(patches) >= 0).all()
    for i, (first, count) in enumerate(zip(starts, counts, strict=True)):
        mine = patches == i
        rows = slice(first, first + count)
        at, pushes, radius = spread_patch(
            block, points[rows], forces[rows], radii[i], bool(convex[i])
        )
        np.testing.assert_allclose(together[0][mine], at, atol=1e-12)
        np.testing.assert_allclose(together[1][mine], pushes, rtol=1e-9)
        np.testing.assert_allclose(together[2][mine], radius)


def test_footprints_of_many_points_equal_footprints_of_single_points() -> None:
    animal = build_atlas(Mesh.from_arrays(*limbed(0.05)), 24, cache=False)
    rng = np.random.default_rng(2)
    areas = animal.areas.reshape(-1)
    movable = rng.uniform(0.5, 1.0, areas.size)
    points = animal.mesh.V[rng.choice(len(animal.mesh.V), 60, replace=False)]
    found = Footprints(animal, movable).under(
        np.zeros(60, int), points, np.full(60, 0.08), np.zeros(1, bool)
    )
    for point, (texels, shares) in zip(points, found, strict=True):
        where = footprint(animal, point, 0.08)
        np.testing.assert_array_equal(texels, where.texels)
        np.testing.assert_allclose(
            shares, where.weights * areas[where.texels] * movable[where.texels]
        )
        assert (where.weights * areas[where.texels]).sum() == pytest.approx(1.0)
