"""Forces of load points spread over the texels of their footprints, against sums worked out in numpy.

Footprints are reused where a load point stays, and kept while its geom is active.
"""

import numpy as np
import pytest

from ripple_sim.coupling.footprints import (
    EMPTY_CACHE,
    NO_FORCES,
    NO_SHARES,
    FootprintCache,
    rebuild,
    reusable,
    texel_forces,
)
from ripple_sim.coupling.patches import LoadPoints, Patches
from ripple_sim.coupling.rest_filter import CONTACT_STATE
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.waves.footprint import footprint


def made_up(points_of: list[int], kept: int, seed: int) -> tuple[Patches, LoadPoints, FootprintCache]:
    """Geoms with so many load points each, and footprints of theirs, followed by others that are only kept."""
    rng, count = np.random.default_rng(seed), sum(points_of)
    geoms = 2 * np.arange(len(points_of)) + 1
    begins = np.cumsum([0, *points_of])
    sizes = rng.integers(1, 9, count + kept)
    sizes[: count // 3] = 0  # footprints on what is not movable
    cut, total = np.cumsum([0, *sizes]), sizes.sum()
    radii = np.repeat(rng.uniform(0.05, 0.2, len(points_of)), points_of)
    nothing = np.zeros((count + kept, 3))
    cache = FootprintCache(
        np.repeat(99, count + kept), nothing, np.zeros(count + kept), np.zeros(count + kept), cut,
        rng.integers(0, 50, total), rng.uniform(0, 1, total),
    )  # fmt: skip
    loads = LoadPoints(
        begins, np.repeat(geoms, points_of), nothing[:count], rng.uniform(0.1, 5, count), radii, nothing[:count],
        np.zeros(count, np.int64),
    )  # fmt: skip
    patch_begins = np.cumsum([0, *(n + 2 for n in points_of)])
    patches = Patches(
        geoms, np.ones(len(geoms)), np.ones(len(geoms)), patch_begins, patch_begins[:-1] + 1,
        np.ones(len(geoms), np.int64), rng.standard_normal((patch_begins[-1], 3)), np.zeros(patch_begins[-1]),
    )  # fmt: skip
    return patches, loads, cache


@pytest.mark.parametrize(("points_of", "kept"), [([1], 0), ([3, 1, 4], 0), ([2, 5], 6), ([36, 36, 36], 3)])
def test_every_texel_of_a_footprint_gets_its_share_of_the_point_force(points_of: list[int], kept: int) -> None:
    patches, points, cache = made_up(points_of, kept, sum(points_of))
    found = texel_forces(patches, points, cache)
    assert found.geoms.tolist() == patches.geoms.tolist()
    for i in range(len(points_of)):
        expected = np.zeros(50)
        for j in range(points.begins[i], points.begins[i + 1]):
            mine = slice(cache.begins[j], cache.begins[j + 1])
            np.add.at(expected, cache.texels[mine], points.forces[j] * cache.shares[mine])
        rows = slice(found.begins[i], found.begins[i + 1])
        np.testing.assert_allclose(np.bincount(found.texels[rows], found.forces[rows], 50), expected, rtol=1e-12)
        np.testing.assert_array_equal(found.middles[i], patches.points[patches.begins[i]])
        assert found.place_radii[i] == points.radii[points.begins[i]] / 2
    assert found.begins[-1] == len(found.texels) == len(found.forces), "those that are only kept give no force"


def test_shares_that_add_up_to_one_hand_on_the_whole_force() -> None:
    patches, points, cache = made_up([2, 3], 2, 5)
    for begin, end in zip(cache.begins[:-1], cache.begins[1:], strict=True):
        cache.shares[begin:end] /= cache.shares[begin:end].sum() if end > begin else 1
    found, movable = texel_forces(patches, points, cache), np.diff(cache.begins)[:5] > 0
    assert not movable.all()
    assert found.forces.sum() == pytest.approx(points.forces @ movable, rel=1e-12)


def test_without_geoms_there_are_no_forces() -> None:
    found = texel_forces(*made_up([], 3, 0))
    for mine, none in zip(found, NO_FORCES, strict=True):
        assert mine.shape == none.shape
        assert mine.dtype == none.dtype
    assert all(len(each) == 0 for each in NO_SHARES)


def load_points_at(atlas: Atlas, geoms: list[int], at: np.ndarray, radius: float) -> LoadPoints:
    places, texels = atlas.nearest(at)
    begins = np.concatenate([[0], np.flatnonzero(np.diff(geoms)) + 1, [len(geoms)]])
    forces, radii = np.ones(len(geoms)), np.full(len(geoms), radius)
    return LoadPoints(begins, np.array(geoms), at, forces, radii, places, texels)


def rebuilt(
    atlas: Atlas, cache: FootprintCache, points: LoadPoints, active: list[int]
) -> tuple[FootprintCache, np.ndarray]:
    states = np.zeros(5, CONTACT_STATE)
    states["active"][active] = True
    rows, lost = reusable(cache, points, states)
    assert not len(lost), "all places are known"
    movable_area, scratch = atlas.areas.reshape(-1), distance_scratch(atlas.areas.size)
    return rebuild(cache, points, rows, atlas.texels.grid, movable_area, scratch), rows


def test_footprints_are_reused_where_a_point_stays_and_kept_while_its_geom_is_active() -> None:
    animal = build_atlas(Mesh.from_arrays(*limbed(0.05)), 24, cache=False)
    rng = np.random.default_rng(2)
    points = animal.mesh.V[rng.integers(0, len(animal.mesh.V), 60)]
    geoms = sorted(rng.integers(1, 5, 60).tolist())
    first, rows = rebuilt(animal, EMPTY_CACHE, load_points_at(animal, geoms, points, 0.08), [])
    assert (rows < 0).all()
    areas = animal.areas.reshape(-1)
    for i, point in enumerate(points):
        where, mine = footprint(animal, point, 0.08), slice(*first.begins[i : i + 2])
        np.testing.assert_array_equal(first.texels[mine], where.texels)
        np.testing.assert_allclose(first.shares[mine], where.weights * areas[where.texels])
        assert first.shares[mine].sum() == pytest.approx(1.0)
    # geom 1 has gone for good, 2 has only lost touch; of the others every second point has moved on
    on = np.array(geoms) > 2
    moved = points[on].copy()
    moved[::2] += 10 * first.tolerances[on][::2, None] * [1.0, 0, 0]
    second, rows = rebuilt(animal, first, load_points_at(animal, np.array(geoms)[on].tolist(), moved, 0.08), [2, 3, 4])
    assert (rows[: on.sum()][::2] != np.flatnonzero(on)[::2]).all()
    np.testing.assert_array_equal(first.points[rows[: on.sum()]][1::2], points[on][1::2])
    np.testing.assert_array_equal(rows[on.sum() :], np.flatnonzero(np.array(geoms) == 2))
    kept = slice(second.begins[on.sum()], None)
    old = slice(first.begins[geoms.index(2)], first.begins[geoms.index(3)])
    np.testing.assert_array_equal(second.texels[kept], first.texels[old])
    np.testing.assert_array_equal(second.shares[kept], first.shares[old])
