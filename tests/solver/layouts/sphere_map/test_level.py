"""Levels of detail renumber a mesh; reference triangles keep areas and shapes."""

import numpy as np
import pytest
from genus_zero import crumpled, stretched
from levels import whole_level

from ripple_sim.solver.layouts import Reference
from ripple_sim.solver.layouts.sphere_map import (
    SPHERE,
    RealSurface,
    carry,
    corner_table,
    decimate,
    update_level,
    update_triangle,
)

EQUILATERAL = 1 / np.sqrt(3)


def areas(V, F):
    return np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2


def source_of(V, F, *, trust=1.0, sliver=1e-9):
    """A mesh scaled to the area of the sphere, with its own areas carried by its vertices."""
    V = V * np.sqrt(4 * np.pi / max(areas(V, F).sum(), 1e-300))
    carried = np.bincount(F.ravel(), np.repeat(areas(V, F) / 3, 3), len(V))
    return RealSurface(V, carried, np.ones(len(V)), trust, sliver, 4 * np.pi / len(F))


def references(source, F):
    """References of the whole mesh."""
    table = corner_table(F, len(source.V))
    reference = Reference(np.zeros(len(F)), np.zeros(3 * len(F)), SPHERE)
    update_level(np.arange(len(source.V)), np.arange(len(F)), table, source, reference)
    return reference


def angle_cotangents(reference):
    return reference.cotangent.reshape(-1, 3) * 2 * reference.area[:, None]


def test_area_is_carried_on_through_a_chain_of_collapses_and_none_is_lost():
    carried = np.array([1.0, 2.0, 4.0, 8.0])
    carry(np.array([0, 1, 2]), np.array([1, 2, 3]), carried)
    assert carried[3] == 15
    V, F = crumpled()
    source = source_of(V, F)
    table = corner_table(F, len(V))
    log = decimate(table, source.V)
    removed = table.tail[log]
    kept = table.tail[table.twin[log]]
    carry(removed, kept, source.carried)
    last = np.setdiff1d(np.arange(len(V)), removed)
    assert source.carried[last].sum() == pytest.approx(4 * np.pi)
    assert (source.carried[last] > 0).all()


def test_full_trust_in_a_whole_mesh_gives_its_own_triangles():
    V, F = stretched([1, 2, 3], subdivisions=2)
    source = source_of(V, F)
    expected = whole_level(source.V, F)[1]
    reference = references(source, F)
    np.testing.assert_allclose(source.load, 1, rtol=1e-12)
    np.testing.assert_allclose(reference.area, expected.area, rtol=1e-12)
    np.testing.assert_allclose(reference.cotangent, expected.cotangent, rtol=1e-9, atol=1e-9)


def test_no_trust_gives_equal_equilateral_triangles():
    V, F = crumpled()
    reference = references(source_of(V, F, trust=0.0), F)
    np.testing.assert_allclose(reference.area, 4 * np.pi / len(F), rtol=1e-12)
    np.testing.assert_allclose(angle_cotangents(reference), EQUILATERAL, rtol=1e-9)


@pytest.mark.parametrize("trust", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("sliver", [0.15, 0.5])
def test_references_of_any_trust_are_triangles_whose_areas_make_up_the_sphere(trust, sliver):
    V, F = crumpled()
    reference = references(source_of(V, F, trust=trust, sliver=sliver), F)
    assert reference.area.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    assert (reference.area > 0).all()
    a, b, c = angle_cotangents(reference).T
    np.testing.assert_allclose(a * b + b * c + c * a, 1, rtol=1e-9)  # angles that add up to pi


def one_triangle(corners, **options):
    V = np.array(corners, dtype=float)
    F = np.array([[0, 1, 2]])
    settings = {"trust": 1.0, "sliver": 0.5} | options
    reference = Reference(np.zeros(1), np.zeros(3), SPHERE)
    source = RealSurface(V, np.ones(3), np.ones(3), settings["trust"], settings["sliver"], 1.0)
    update_triangle(0, F.ravel().astype(np.int32), source, reference)
    return reference


def test_only_slivers_are_pulled_towards_equilateral():
    good = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    np.testing.assert_allclose(angle_cotangents(one_triangle(good)), [[0, 1, 1]], atol=1e-12)
    thin = [[0, 0, 0], [1, 0, 0], [0.5, 0.01, 0]]
    steepest = [
        np.abs(angle_cotangents(one_triangle(thin, sliver=sliver))).max()
        for sliver in (1e-6, 0.15, 0.5)
    ]
    assert steepest[0] == pytest.approx(50, rel=1e-6)
    assert steepest[0] > 5 * steepest[1] > 5 * steepest[2] > 5 * EQUILATERAL


@pytest.mark.parametrize(
    "corners",
    [[[1, 1, 1]] * 3, [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 0], [0, 0, 0], [1, 0, 0]]],
)
def test_a_triangle_without_area_gets_the_smallest_share_and_finite_cotangents(corners):
    reference = one_triangle(corners)
    assert reference.area[0] == pytest.approx(1e-3)  # of the mean
    a, b, c = angle_cotangents(reference)[0]
    assert a * b + b * c + c * a == pytest.approx(1, rel=1e-6)
