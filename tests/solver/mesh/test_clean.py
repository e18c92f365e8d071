"""Cleaning gives a sound mesh of the same area and texture, or refuses."""

import re

import numpy as np
import pytest
from all_kinds import (
    BALL,
    band,
    crumbs,
    cube,
    klein_bottle,
    needles,
    punctured_ball,
    shuffled,
    thickened_graph,
    voxels,
)
from hypothesis import given, settings, strategies as st
from sound import assert_sound, assert_unchanged_when_read_again

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, MeshError, build_atlas

quick = settings(derandomize=True, max_examples=40, deadline=None, database=None)


def areas(V: np.ndarray, F: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2


def integral(V: np.ndarray, F: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Integral of the texture coordinates over the surface, however it is cut."""
    return areas(V, F) @ uv.mean(axis=1)


def made(V: np.ndarray, F: np.ndarray) -> Mesh:
    """The mesh of a soup of triangles with an area, no two of them the same."""
    uv = np.random.default_rng(0).uniform(size=(len(F), 3, 2))
    mesh = Mesh.from_arrays(V, F, uv)
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    assert mesh.area == pytest.approx(areas(V, F).sum(), rel=1e-9)
    assert mesh.corner_uv is not None
    np.testing.assert_allclose(
        integral(mesh.V, mesh.F, mesh.corner_uv), integral(V, F, uv), rtol=1e-9
    )
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
        assert rim[0] == rim.min()
        # seen from outside the surface lies to the left, so the rim runs clockwise round the hole
        P = mesh.V[rim]
        assert np.einsum("ij,ij->", np.cross(P, np.roll(P, -1, axis=0)), P) == pytest.approx(
            0, abs=1e-12
        )
        assert np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0) @ P.mean(axis=0) < 0


@pytest.mark.parametrize("half_twists", range(4))
@pytest.mark.parametrize("loose", [False, True])
def test_bands_keep_two_rims_and_moebius_bands_are_cut(half_twists: int, loose: bool) -> None:
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
    # numbered by their first triangles
    assert (np.diff(np.unique(mesh.components, return_index=True)[1]) > 0).all()
    # half of them are tetrahedra, and face outwards
    P = V.reshape(-1, 4, 3)[1::2]
    assert mesh.volume == pytest.approx(np.abs(np.linalg.det(P[:, 1:] - P[:, :1])).sum() / 6)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_few_triangles_are_a_mesh(count: int) -> None:
    for V, F in (
        needles(count),
        needles(count, 0.5),
        (np.random.default_rng(0).uniform(size=(3 * count, 3)), None),
    ):
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


three = {"min_size": 3, "max_size": 3}
corner = st.tuples(*[st.integers(0, 2)] * 3)


@quick
@given(
    F=st.lists(st.lists(st.integers(0, 9), **three, unique=True), min_size=1, max_size=40),
    seed=st.integers(0, 9),
)
def test_any_triangles_between_ten_points_become_a_mesh(F: list[list[int]], seed: int) -> None:
    distinct = list({tuple(sorted(triangle)): triangle for triangle in F}.values())
    made(np.random.default_rng(seed).uniform(size=(10, 3)), np.array(distinct))


@quick
@given(triangles=st.lists(st.lists(corner, **three), min_size=1, max_size=30))
def test_any_triangles_on_a_lattice_become_a_mesh_or_have_no_area(triangles) -> None:
    # points in line, planes in common, triangles in each other
    V = np.array(triangles, dtype=float).reshape(-1, 3)
    F = np.arange(len(V)).reshape(-1, 3)
    uv = np.random.default_rng(0).uniform(size=(len(V), 2))
    try:
        mesh = Mesh.from_arrays(V, F, uv)
    except MeshError as error:
        assert re.search("no triangle with an area|size must be .*, got 0 m", str(error))
        assert not areas(V, F).any()
        return
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    assert mesh.area <= areas(V, F).sum() * (1 + 1e-12)


faces = st.lists(st.integers(0, len(BALL.faces) - 1), max_size=6)
corners = st.lists(st.tuples(st.integers(0, len(BALL.faces) - 1), st.integers(0, 2)), max_size=3)
vertices = st.integers(0, len(BALL.vertices) - 1)
pairs = st.tuples(vertices, vertices)


def mended_or_refused(V, F, uv=None) -> Mesh | None:
    try:
        mesh = Mesh.from_arrays(V, F, uv)
    except MeshError as error:
        assert "\n" not in str(error)
        return None
    assert_sound(mesh)
    assert (uv is None) == (mesh.corner_uv is None)
    assert_unchanged_when_read_again(mesh)
    return mesh


@quick
@given(flipped=faces, doubled=faces, turned=faces, seed=st.integers(0, 9))
def test_flips_duplicates_and_shuffles_are_mended(flipped, doubled, turned, seed) -> None:
    F = np.array(BALL.faces)
    F[flipped] = F[flipped][:, ::-1]
    F[turned] = np.roll(F[turned], 1, axis=1)
    F = np.vstack([F, F[doubled]])
    mesh = mended_or_refused(*shuffled(np.array(BALL.vertices), F, seed))
    assert mesh is not None
    assert mesh.closed and mesh.genus.tolist() == [0]
    assert (len(mesh.V), len(mesh.F)) == (42, 80)
    assert mesh.volume == pytest.approx(BALL.volume)


@quick
@given(deleted=faces.filter(len), flipped=faces)
def test_deletions_leave_rims(deleted, flipped) -> None:
    F = np.array(BALL.faces)
    F[flipped] = F[flipped][:, ::-1]
    F = np.delete(F, deleted, axis=0)
    _, counts = np.unique(
        np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
    )
    mesh = mended_or_refused(np.array(BALL.vertices), F)
    assert mesh is not None
    assert not mesh.closed
    assert sum(map(len, mesh.rims)) == (counts == 1).sum()
    assert (
        mesh.component_count > 1 or (np.einsum("ij,ij->i", mesh.vertex_normals, mesh.V) > 0).all()
    )


@quick
@given(deleted=faces, doubled=faces, flipped=faces, rewired=corners, target=vertices, joined=pairs)
def test_any_damage_is_mended_or_refused(
    deleted, doubled, flipped, rewired, target, joined
) -> None:
    V = np.array(BALL.vertices)
    F = np.array(BALL.faces)
    for face, corner in rewired:
        F[face, corner] = target
    F[flipped] = F[flipped][:, ::-1]
    V[joined[0]] = V[joined[1]]
    F = np.vstack([np.delete(F, deleted, axis=0), F[doubled]])
    mended_or_refused(V, F, np.random.default_rng(0).uniform(size=(len(V), 2)))


@quick
@given(
    values=st.lists(st.floats(width=64), min_size=9, max_size=9),
    where=st.lists(vertices, **three, unique=True),
)
def test_any_coordinates_are_mended_or_refused(values, where) -> None:
    V = np.array(BALL.vertices)
    V[where] = np.array(values).reshape(3, 3)
    with np.errstate(all="raise"):
        mended_or_refused(V, BALL.faces)


@pytest.fixture(scope="module")
def animal() -> Atlas:
    return build_atlas(Mesh.from_arrays(*limbed(0.04)), 32, cache=False)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_units_do_not_matter(animal: Atlas, scale: float) -> None:
    atlas = build_atlas(
        Mesh.from_arrays(animal.mesh.V * scale, animal.mesh.F), animal.resolution, cache=False
    )
    np.testing.assert_allclose(atlas.positions / scale, animal.positions, atol=1e-9)
    np.testing.assert_allclose(atlas.areas / scale**2, animal.areas, rtol=1e-6)
    lengths = {"edge_min", "edge_max"}
    for name, value in animal.quality().items():
        assert atlas.quality()[name] == pytest.approx(
            value * (scale if name in lengths else 1), rel=1e-6
        )


def test_place_does_not_matter(animal: Atlas) -> None:
    # far from the origin the vertices are rounded otherwise, and another turn of the cube may seem
    # the best
    mesh = Mesh.from_arrays(animal.mesh.V + np.array([300.0, -20.0, 1.0]), animal.mesh.F)
    quality = build_atlas(mesh, animal.resolution, cache=False).quality()
    for name, value in animal.quality().items():
        assert quality[name] == pytest.approx(
            value, rel=0.25 if name in ("edge_min", "edge_max") else 0.05
        )


@pytest.mark.parametrize(("gap", "parts"), [(3e-8, 1), (1e-3, 2)])
def test_hairline_cracks_are_closed_but_gaps_are_not(gap: float, parts: int) -> None:
    V, F = cube()
    mesh = Mesh.from_arrays(np.vstack([V, V + gap]), np.vstack([F[:5], F[5:] + 8]))
    assert (mesh.component_count, len(mesh.F)) == (parts, 12)
    assert mesh.closed == any("cracks closed" in note for note in mesh.notes) == (parts == 1)
