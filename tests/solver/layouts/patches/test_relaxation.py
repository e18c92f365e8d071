"""Relaxed maps: no fold, every chart covered once, less energy than in the beginning."""

import numpy as np
import pytest
from surfaces import disk, torus

from ripple_sim.solver.layouts.patches.cells import Metric, centred_cells, spread_seeds
from ripple_sim.solver.layouts.patches.disks import disk_cells, signed_areas
from ripple_sim.solver.layouts.patches.energy import reference_of, total_energy
from ripple_sim.solver.layouts.patches.quads import cut_into_quads
from ripple_sim.solver.layouts.patches.relaxation import relax
from ripple_sim.solver.layouts.patches.samples import locate_texels
from ripple_sim.solver.layouts.patches.seamless import corner_places, seamless_map
from ripple_sim.solver.layouts.patches.surface import Surface


@pytest.mark.parametrize("mesh", [torus(20), disk(14)], ids=["torus", "disk"])
def test_a_relaxed_map_covers_the_charts_once_with_less_energy(mesh) -> None:
    surface = Surface.of(mesh.V, mesh.F)
    metric = Metric.of(surface)
    reach = 0.75 * np.sqrt(surface.areas.sum() / 8)
    quads = cut_into_quads(disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach))))
    seamless = seamless_map(quads)
    relax(quads.surface.V, seamless)
    areas = signed_areas(corner_places(seamless))
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(len(quads.glued))
    assert (seamless.x >= 0).all() and (seamless.x <= 1).all()
    F, V = quads.surface.F, quads.surface.V
    reference = reference_of(V, F, len(quads.glued), 2)
    assert total_energy(seamless, reference) < 0.9 * total_energy(seamless_map(quads), reference)
    triangles, _ = locate_texels(seamless, 16)
    assert (triangles >= 0).all()
