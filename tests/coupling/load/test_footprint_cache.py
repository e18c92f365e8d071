"""Footprints are reused where a load point stays, and kept while its geom is active."""

import numpy as np
import pytest

from ripple_sim.coupling.footprints import EMPTY_CACHE, FootprintCache, rebuild, reusable
from ripple_sim.coupling.patches import LoadPoints
from ripple_sim.coupling.rest_filter import CONTACT_STATE
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.waves.footprint import footprint


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
