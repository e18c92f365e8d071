"""Vertices that only cuts have made are taken away: the surface and the map stay, the triangles are fewer."""

import numpy as np
import pytest
from surfaces import disk, torus

from ripple_sim.solver.layouts.patches.cells import Metric, centred_cells, spread_seeds
from ripple_sim.solver.layouts.patches.collapse import without_cuts
from ripple_sim.solver.layouts.patches.disks import disk_cells, signed_areas
from ripple_sim.solver.layouts.patches.quads import cut_into_quads
from ripple_sim.solver.layouts.patches.samples import locate_texels
from ripple_sim.solver.layouts.patches.seamless import FIXED, corner_places, seamless_map
from ripple_sim.solver.layouts.patches.surface import Surface


@pytest.mark.parametrize("mesh", [torus(20), disk(14)], ids=["torus", "disk"])
def test_fewer_triangles_cover_the_same_surface_and_charts_once(mesh) -> None:
    metric = Metric.of(Surface.of(mesh.V, mesh.F))
    reach = 0.75 * np.sqrt(metric.surface.areas.sum() / 8)
    quads = cut_into_quads(disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach))))
    whole = seamless_map(quads)
    surface, seamless = without_cuts(quads.surface, whole, quads.cut)
    assert len(surface.F) < 0.7 * len(quads.surface.F)
    places = signed_areas(corner_places(seamless))
    assert places.min() > 0
    np.testing.assert_allclose(places.sum(), len(quads.glued), rtol=1e-9)
    # each triangle of the mesh is covered once, by triangles that lie where they say
    share = np.linalg.det(surface.inside)
    assert share.min() > 0
    np.testing.assert_allclose(np.bincount(surface.parent, share), 1.0, rtol=1e-9)
    points = np.einsum("fij,fjk->fik", surface.inside, mesh.V[mesh.F[surface.parent]])
    np.testing.assert_allclose(points, surface.V[surface.F], atol=1e-12)
    assert np.bincount(surface.edges.of.ravel()).max() == 2
    assert (seamless.freedom == FIXED).sum() == (whole.freedom == FIXED).sum()
    locate_texels(seamless, 9)  # finds a triangle for each
