"""Forces of load points spread over the texels of their footprints, against sums worked out in numpy."""

import numpy as np
import pytest

from ripple_sim.coupling.footprints import NO_FORCES, NO_SHARES, FootprintCache, texel_forces
from ripple_sim.coupling.patches import LoadPoints, Patches


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
