"""Quads of cells: each laid out as a square without a fold, glued as the surface is."""

import numpy as np
import pytest
from surfaces import disk, sphere, torus

from ripple_sim.solver import glue
from ripple_sim.solver.layouts.patches.cells import BorderedCells, Metric, centred_cells, spread_seeds
from ripple_sim.solver.layouts.patches.disks import disk_cells, signed_areas
from ripple_sim.solver.layouts.patches.quads import Quads, cut_into_large_quads, cut_into_quads
from ripple_sim.solver.layouts.patches.surface import Surface

MESHES = {"sphere": lambda: sphere(3), "torus": lambda: torus(24), "disk": lambda: disk(14)}
EULER = {"sphere": 2, "torus": 0, "disk": 1}


def cells_of(name: str, cells: int) -> BorderedCells:
    mesh = MESHES[name]()
    surface = Surface.of(mesh.V, mesh.F)
    metric = Metric.of(surface)
    reach = 0.75 * np.sqrt(surface.areas.sum() / cells) if cells > 1 else np.inf
    return disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach)))


def quads_of(name: str, cells: int) -> Quads:
    return cut_into_quads(cells_of(name, cells))


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("cells", [1, 6, 12])
def test_quads_cover_the_surface_and_their_squares_once(name: str, cells: int) -> None:
    assert_covered_once(name, quads_of(name, cells))


@pytest.mark.parametrize("name", MESHES)
def test_large_quads_cover_the_surface_once_and_three_meet_at_least(name: str) -> None:
    cells = cells_of(name, 24)
    quads = cut_into_large_quads(cells)
    assert quads is not None
    assert_covered_once(name, quads)
    assert len(quads.glued) < 1.5 * len(cells.arcs) < 0.5 * sum(map(len, cells.arcs))
    topology = glue(quads.glued, 2)
    assert topology.valence[topology.valence > 0].min() >= 3
    assert_topology(name, quads)


def test_a_surface_of_too_few_cells_has_no_large_quads() -> None:
    assert cut_into_large_quads(cells_of("sphere", 4)) is None


def assert_covered_once(name: str, quads: Quads) -> None:
    areas = signed_areas(quads.places)
    assert areas.min() > 0
    np.testing.assert_allclose(np.bincount(quads.chart, areas), 1.0, atol=1e-9)
    assert quads.surface.areas.sum() == pytest.approx(Surface.of(MESHES[name]().V, MESHES[name]().F).areas.sum())


@pytest.mark.parametrize("name", MESHES)
def test_glued_charts_have_the_topology_of_the_surface(name: str) -> None:
    assert_topology(name, quads_of(name, 10))


def assert_topology(name: str, quads: Quads) -> None:
    glued = quads.glued
    corners = len(np.unique(glue(glued, 2).corners))
    sides = (glued[..., 0] >= 0).sum() / 2 + (glued[..., 0] < 0).sum()
    assert corners - sides + len(glued) == EULER[name]


def test_a_part_of_one_cell_has_charts() -> None:
    assert len(quads_of("disk", 1).glued) == 4
