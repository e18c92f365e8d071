"""Whatever its handles, holes, twists and parts: a sound mesh, of the same area, with the same texture coordinates."""

from __future__ import annotations

import re

import numpy as np
import pytest
from all_kinds import band, crumbs, klein_bottle, needles, punctured_ball, shuffled, thickened_graph, voxels
from hypothesis import given, settings
from hypothesis import strategies as st
from sound import assert_sound, assert_unchanged_when_read_again

from ripple_sim.solver import Mesh, MeshError

quick = settings(derandomize=True, max_examples=40, deadline=None, database=None)


def areas(V: np.ndarray, F: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2


def integral(V: np.ndarray, F: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Of the texture coordinates over the surface: the same however triangles are cut and ordered."""
    return areas(V, F) @ uv.mean(axis=1)


def made(V: np.ndarray, F: np.ndarray) -> Mesh:
    """The mesh of a soup of triangles with an area, no two of them the same."""
    uv = np.random.default_rng(0).uniform(size=(len(F), 3, 2))
    mesh = Mesh.from_arrays(V, F, uv)
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    assert mesh.area == pytest.approx(areas(V, F).sum(), rel=1e-9)
    assert mesh.corner_uv is not None
    np.testing.assert_allclose(integral(mesh.V, mesh.F, mesh.corner_uv), integral(V, F, uv), rtol=1e-9)
    return mesh


@pytest.mark.parametrize("genus", range(6))
def test_thickened_graphs_have_a_handle_for_every_cycle(genus: int) -> None:
    V, F = thickened_graph(genus, 0)
    for loose in (False, True):
        mesh = made(*shuffled(V, F, 0, turned=0.5, loose=loose))
        assert mesh.closed
        assert mesh.genus.tolist() == [genus]
        assert mesh.volume > 0
        assert not any("cut" in note for note in mesh.notes)


@pytest.mark.parametrize(("genus", "cuts"), [(1, 1), (3, 40)])
def test_holes_in_a_surface_with_handles_leave_the_handles(genus: int, cuts: int) -> None:
    V, F = thickened_graph(genus, 0)
    open_F = np.delete(F, np.random.default_rng(cuts).choice(len(F), cuts, replace=False), axis=0)
    mesh = made(V, open_F)
    assert mesh.genus.sum() == genus
    assert 1 <= len(mesh.rims) <= cuts


@pytest.mark.parametrize("holes", [1, 2, 7, 20])
def test_every_hole_of_a_ball_is_a_rim_that_runs_round_it(holes: int) -> None:
    V, F = punctured_ball(holes, holes)
    mesh = made(*shuffled(V, F, holes, turned=0.2))
    assert len(mesh.rims) == holes
    assert mesh.genus.tolist() == [0]
    assert mesh.volume == 0
    # most triangles were wound outwards
    assert (np.einsum("ij,ij->i", mesh.vertex_normals, mesh.V) > 0.9).all()
    for rim in mesh.rims:
        # seen from outside the surface lies to the left, so the rim runs clockwise round the hole
        P = mesh.V[rim]
        assert np.einsum("ij,ij->", np.cross(P, np.roll(P, -1, axis=0)), P) == pytest.approx(0, abs=1e-12)
        assert np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0) @ P.mean(axis=0) < 0


@pytest.mark.parametrize("half_twists", range(4))
@pytest.mark.parametrize("loose", [False, True])
def test_bands_keep_two_rims_and_moebius_bands_are_cut_across(half_twists: int, loose: bool) -> None:
    V, F = band(half_twists)
    mesh = made(*shuffled(V, F, half_twists, turned=0.3, loose=loose))
    cut = [note for note in mesh.notes if "one-sided" in note]
    assert mesh.component_count == 1
    assert mesh.genus.tolist() == [0]
    assert len(cut) == half_twists % 2
    assert len(mesh.rims) == (1 if half_twists % 2 else 2)
    if cut:
        # the shortest way across has 4 edges
        assert int(cut[0].split()[3]) <= 8


@pytest.mark.parametrize("loose", [False, True])
def test_a_klein_bottle_is_cut_open(loose: bool) -> None:
    mesh = made(*shuffled(*klein_bottle(), 0, turned=0.5, loose=loose))
    assert any("one-sided" in note for note in mesh.notes)
    assert mesh.component_count == 1
    assert not mesh.closed


def test_a_thousand_parts_stay_a_thousand() -> None:
    V, F = crumbs(1000)
    mesh = made(*shuffled(V, F, 0, turned=0.5))
    assert mesh.component_count == 1000
    assert len(mesh.rims) == 500
    assert not mesh.genus.any()
    # half of them are tetrahedra, and face outwards
    P = V.reshape(-1, 4, 3)[1::2]
    assert mesh.volume == pytest.approx(np.abs(np.linalg.det(P[:, 1:] - P[:, :1])).sum() / 6)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_few_triangles_are_a_mesh(count: int) -> None:
    for V, F in (needles(count), needles(count, 0.5), (np.random.default_rng(0).uniform(size=(3 * count, 3)), None)):
        given = np.arange(3 * count).reshape(-1, 3) if F is None else F
        mesh = made(V, given)
        assert mesh.component_count == (count if F is None else 1)
        assert len(mesh.rims) == mesh.component_count


def test_needles_stay_and_lines_are_dropped() -> None:
    V, F = needles(50)
    assert len(made(V, F).F) == 50
    mesh = Mesh.from_arrays(np.vstack([V, [[2, 0, 0]]]), np.vstack([F, [[0, 1, 52]]]))
    assert len(mesh.F) == 50
    assert "1 triangle without area dropped" in mesh.notes


def test_a_line_between_triangles_is_taken_out_without_a_gap() -> None:
    # the lower triangle ends at the line's long side, the upper ones at its two short sides
    V = np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0], [1, -2, 0], [1, 2, 0]], dtype=float)
    F = np.array([[0, 1, 4], [1, 2, 4], [0, 2, 1], [0, 3, 2]])
    uv = V[F][..., :2]
    mesh = Mesh.from_arrays(V, F, uv)
    assert_sound(mesh)
    assert len(mesh.F) == 4
    assert [len(rim) for rim in mesh.rims] == [4]
    assert mesh.area == pytest.approx(6)
    assert mesh.corner_uv is not None
    np.testing.assert_allclose(mesh.corner_uv, mesh.V[mesh.F][..., :2], atol=1e-15)


@quick
@given(seed=st.integers(0, 10**6), filled=st.floats(0.1, 0.9))
def test_cells_that_touch_along_edges_stay_bodies_of_their_volume(seed: int, filled: float) -> None:
    # two layers: no cavity, whose surface would face outwards and count as a body
    cells = np.random.default_rng(seed).random((2, 4, 4)) < filled
    if not cells.any():
        return
    mesh = made(*shuffled(*voxels(cells), seed, loose=True))
    assert mesh.closed
    assert mesh.volume == pytest.approx(cells.sum())


@quick
@given(
    F=st.lists(st.lists(st.integers(0, 9), min_size=3, max_size=3, unique=True), min_size=1, max_size=40),
    seed=st.integers(0, 9),
)
def test_any_triangles_between_ten_points_become_a_mesh(F: list[list[int]], seed: int) -> None:
    distinct = list({tuple(sorted(triangle)): triangle for triangle in F}.values())
    made(np.random.default_rng(seed).uniform(size=(10, 3)), np.array(distinct))


@quick
@given(
    triangles=st.lists(st.lists(st.tuples(*[st.integers(0, 2)] * 3), min_size=3, max_size=3), min_size=1, max_size=30)
)
def test_any_triangles_on_a_lattice_become_a_mesh_or_have_no_area(triangles) -> None:
    # points in line, planes in common, triangles in each other
    V = np.array(triangles, dtype=float).reshape(-1, 3)
    F = np.arange(len(V)).reshape(-1, 3)
    uv = np.random.default_rng(0).uniform(size=(len(V), 2))
    try:
        mesh = Mesh.from_arrays(V, F, uv)
    except MeshError as error:
        assert re.search("no triangle with an area|size is 0 m", str(error))
        assert not areas(V, F).any()
        return
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    assert mesh.area <= areas(V, F).sum() * (1 + 1e-12)
