"""Footprints are reused where a load point stays, and kept while its geom is active."""

import numpy as np
import pytest

from ripple_sim.coupling.patches import Footprints
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Mesh, build_atlas
from ripple_sim.solver.waves.footprint import footprint


def test_footprints_are_reused_where_a_point_stays_and_kept_while_its_geom_is_active() -> None:
    animal = build_atlas(Mesh.from_arrays(*limbed(0.05)), 24, cache=False)
    rng, areas = np.random.default_rng(2), animal.areas.reshape(-1)
    movable = rng.uniform(0.5, 1.0, areas.size)
    points = animal.mesh.V[rng.choice(len(animal.mesh.V), 60, replace=False)]
    geoms, radii, nobody = np.sort(rng.integers(1, 5, 60)), np.full(60, 0.08), np.zeros(5, bool)
    footprints = Footprints(animal, movable)
    first = footprints.under(geoms, points, radii, nobody)
    for point, (texels, shares) in zip(points, first, strict=True):
        where = footprint(animal, point, 0.08)
        np.testing.assert_array_equal(texels, where.texels)
        np.testing.assert_allclose(shares, where.weights * areas[where.texels] * movable[where.texels])
        assert (where.weights * areas[where.texels]).sum() == pytest.approx(1.0)
    # geom 1 has gone for good, 2 has only lost touch; of the others every second point has moved on
    on, moved = geoms > 2, points.copy()
    moved[1::2] += [np.sqrt(areas.max()), 0, 0]
    second = footprints.under(geoms[on], moved[on], radii[on], np.array([False, False, True, True, True]))
    assert [after is first[i] for i, after in zip(np.flatnonzero(on), second, strict=True)] == [
        i % 2 == 0 for i in np.flatnonzero(on)
    ]
    # then all are back where they were
    third = footprints.under(geoms, points, radii, nobody)
    expected = (geoms == 2) | (on & (np.arange(60) % 2 == 0))
    assert [after is before for after, before in zip(third, first, strict=True)] == expected.tolist()
