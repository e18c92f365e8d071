"""Tips of cones that move: the energy falls, no triangle folds, and each chart is still covered once."""

import numpy as np
from surfaces import torus

from ripple_sim.solver.layouts.patches.cells import Metric, centred_cells, spread_seeds
from ripple_sim.solver.layouts.patches.cones import move_tips
from ripple_sim.solver.layouts.patches.disks import disk_cells, signed_areas
from ripple_sim.solver.layouts.patches.energy import reference_of, total_energy
from ripple_sim.solver.layouts.patches.quads import cut_into_quads
from ripple_sim.solver.layouts.patches.samples import locate_texels
from ripple_sim.solver.layouts.patches.seamless import FIXED, FREE, corner_places, seamless_map, transitions
from ripple_sim.solver.layouts.patches.surface import Surface


def test_moved_tips_lower_the_energy_and_leave_the_map_one_to_one() -> None:
    mesh = torus(24)
    metric = Metric.of(Surface.of(mesh.V, mesh.F))
    quads = cut_into_quads(disk_cells(metric, centred_cells(metric, spread_seeds(metric, 0.4))))
    seamless, surface = seamless_map(quads), quads.surface
    reference = reference_of(surface.V, surface.F, len(quads.glued), 2)
    tips = np.flatnonzero(seamless.freedom == FIXED)
    before = total_energy(seamless, reference)
    moved = move_tips(seamless, reference, transitions(quads.glued), tips)
    assert len(moved)
    assert total_energy(seamless, reference) < before
    assert (seamless.freedom == FIXED).sum() == len(tips)
    places = corner_places(seamless)
    assert signed_areas(places).min() > 0
    np.testing.assert_allclose(signed_areas(places).sum(), len(quads.glued), rtol=1e-9)
    turns = _angles(seamless.F, places, len(surface.V)) / (2 * np.pi)
    np.testing.assert_allclose(turns[seamless.freedom == FREE], 1.0, atol=1e-9)
    locate_texels(seamless, 9)  # finds a triangle for each


def _angles(F: np.ndarray, places: np.ndarray, count: int) -> np.ndarray:
    total = np.zeros(count)
    for k in range(3):
        u, v = places[:, (k + 1) % 3] - places[:, k], places[:, (k + 2) % 3] - places[:, k]
        angle = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
        total += np.bincount(F[:, k], angle, count)
    return total
