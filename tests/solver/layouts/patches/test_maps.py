"""Maps onto charts that are coarsened, relaxed, or have the tips of their cones moved: still one to one."""

import numpy as np
import pytest
from surfaces import disk, torus

from ripple_sim.solver import Mesh
from ripple_sim.solver.layouts.energy import FIXED, FREE
from ripple_sim.solver.layouts.patches.cells import Metric, centred_cells, spread_seeds
from ripple_sim.solver.layouts.patches.collapse import without_cuts
from ripple_sim.solver.layouts.patches.disks import disk_cells, signed_areas
from ripple_sim.solver.layouts.patches.energy import shapes_of, total_energy
from ripple_sim.solver.layouts.patches.layout import move_tips, relax
from ripple_sim.solver.layouts.patches.quads import Quads, cut_into_quads
from ripple_sim.solver.layouts.patches.samples import locate_texels
from ripple_sim.solver.layouts.patches.seamless import SeamlessMap, corner_places, seamless_map, transitions
from ripple_sim.solver.layouts.patches.surface import Surface


@pytest.fixture(scope="module", params=["torus", "disk"])
def mesh(request: pytest.FixtureRequest) -> Mesh:
    return torus(20) if request.param == "torus" else disk(14)


@pytest.fixture(scope="module")
def quads(mesh: Mesh) -> Quads:
    metric = Metric.of(Surface.of(mesh.V, mesh.F))
    reach = 0.75 * np.sqrt(metric.surface.areas.sum() / 8)
    return cut_into_quads(disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach))))


def assert_one_to_one(seamless: SeamlessMap) -> np.ndarray:
    """No triangle is folded, each chart is covered once, and every texel found; returns the places of corners."""
    places = corner_places(seamless)
    areas = signed_areas(places)
    assert areas.min() > 0
    np.testing.assert_allclose(areas.sum(), len(seamless.glued), rtol=1e-9)
    assert (locate_texels(seamless, 9)[0] >= 0).all()
    return places


def test_fewer_triangles_cover_the_same_surface_and_charts_once(mesh: Mesh, quads: Quads) -> None:
    whole = seamless_map(quads)
    surface, seamless = without_cuts(quads.surface, whole, quads.cut)
    assert len(surface.F) < 0.7 * len(quads.surface.F)
    assert_one_to_one(seamless)
    # each triangle of the mesh is covered once, by triangles that lie where they say
    share = np.linalg.det(surface.inside)
    assert share.min() > 0
    np.testing.assert_allclose(np.bincount(surface.parent, share), 1.0, rtol=1e-9)
    points = np.einsum("fij,fjk->fik", surface.inside, mesh.V[mesh.F[surface.parent]])
    np.testing.assert_allclose(points, surface.V[surface.F], atol=1e-12)
    assert np.bincount(surface.edges.of.ravel()).max() == 2
    assert (seamless.freedom == FIXED).sum() == (whole.freedom == FIXED).sum()


def test_a_relaxed_map_covers_the_charts_once_with_less_energy(quads: Quads) -> None:
    seamless = seamless_map(quads)
    shapes = shapes_of(quads.surface.V, quads.surface.F, len(quads.glued))
    before = total_energy(seamless, shapes)
    relax(quads.surface.V, seamless)
    assert_one_to_one(seamless)
    assert (seamless.x >= 0).all() and (seamless.x <= 1).all()
    assert total_energy(seamless, shapes) < 0.9 * before


def test_moved_tips_lower_the_energy_and_leave_the_map_one_to_one(quads: Quads) -> None:
    seamless = seamless_map(quads)
    shapes = shapes_of(quads.surface.V, quads.surface.F, len(quads.glued))
    tips = np.flatnonzero(seamless.freedom == FIXED)
    before = total_energy(seamless, shapes)
    assert len(move_tips(seamless, shapes, transitions(quads.glued), tips))
    assert total_energy(seamless, shapes) < before
    assert (seamless.freedom == FIXED).sum() == len(tips)
    places = assert_one_to_one(seamless)
    total = np.zeros(len(seamless.x))
    for k in range(3):
        u, v = places[:, (k + 1) % 3] - places[:, k], places[:, (k + 2) % 3] - places[:, k]
        angle = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
        total += np.bincount(seamless.F[:, k], angle, len(total))
    np.testing.assert_allclose(total[seamless.freedom == FREE] / (2 * np.pi), 1.0, atol=1e-9)
