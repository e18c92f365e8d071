"""Damaged meshes are mended or refused, never anything else; and what must not matter does not."""

from __future__ import annotations

import itertools
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, MeshError, build_atlas, sphere_atlas
from ripple_sim.solver.atlas.build import atlas_from_sphere_map
from ripple_sim.solver.cube_map.convention import CHART_NORMALS, CHART_U, CHART_V
from ripple_sim.solver.mesh.repair import repaired

BALL = trimesh.creation.icosphere(subdivisions=1)
quick = settings(derandomize=True, max_examples=60, deadline=None, database=None)
faces = st.lists(st.integers(0, len(BALL.faces) - 1), max_size=6)
corners = st.lists(st.tuples(st.integers(0, len(BALL.faces) - 1), st.integers(0, 2)), max_size=3)
vertices = st.integers(0, len(BALL.vertices) - 1)


def is_closed_sphere(mesh: Mesh) -> bool:
    half_edges = mesh.F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forward = {tuple(edge) for edge in half_edges}
    each_once = len(forward) == len(half_edges) and all((b, a) in forward for a, b in forward)
    return each_once and len(mesh.V) - len(half_edges) // 2 + len(mesh.F) == 2 and mesh.volume > 0


def mended_or_refused(V, F, uv=None) -> Mesh | None:
    try:
        mesh = Mesh.from_arrays(V, F, uv)
    except MeshError as error:
        assert "\n" not in str(error)
        return None
    assert is_closed_sphere(mesh)
    if uv is not None:
        assert mesh.corner_uv is not None and mesh.corner_uv.shape == (*mesh.F.shape, 2)
    return mesh


@quick
@given(flipped=faces, doubled=faces, turned=faces, seed=st.integers(0, 9))
def test_flips_duplicates_and_shuffles_are_mended(flipped, doubled, turned, seed) -> None:
    F = np.array(BALL.faces)
    F[flipped] = F[flipped][:, ::-1]
    F[turned] = np.roll(F[turned], 1, axis=1)
    F = np.vstack([F, F[doubled]])
    rng = np.random.default_rng(seed)
    F = F[rng.permutation(len(F))]
    order = rng.permutation(len(BALL.vertices))
    mesh = mended_or_refused(np.array(BALL.vertices)[np.argsort(order)], order[F])
    assert mesh is not None
    assert (len(mesh.V), len(mesh.F)) == (42, 80)
    assert mesh.volume == pytest.approx(BALL.volume)


@quick
@given(deleted=faces.filter(len), flipped=faces)
def test_deletions_are_refused_with_the_number_of_boundary_edges(deleted, flipped) -> None:
    F = np.array(BALL.faces)
    F[flipped] = F[flipped][:, ::-1]
    F = np.delete(F, deleted, axis=0)
    _, counts = np.unique(np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    with pytest.raises(MeshError, match=rf"open: {(counts == 1).sum()} boundary edge"):
        Mesh.from_arrays(BALL.vertices, F)


@quick
@given(
    deleted=faces, doubled=faces, flipped=faces, rewired=corners, target=vertices, joined=st.tuples(vertices, vertices)
)
def test_any_damage_is_mended_or_refused(deleted, doubled, flipped, rewired, target, joined) -> None:
    V, F = np.array(BALL.vertices), np.array(BALL.faces)
    for face, corner in rewired:
        F[face, corner] = target
    F[flipped] = F[flipped][:, ::-1]
    V[joined[0]] = V[joined[1]]
    F = np.vstack([np.delete(F, deleted, axis=0), F[doubled]])
    mended_or_refused(V, F, np.random.default_rng(0).uniform(size=(len(V), 2)))


@quick
@given(F=st.lists(st.tuples(*[st.integers(0, 7)] * 3), min_size=1, max_size=30))
def test_any_soup_is_mended_or_refused(F) -> None:
    mended_or_refused(np.random.default_rng(1).uniform(size=(8, 3)), F)


@quick
@given(
    values=st.lists(st.floats(width=64), min_size=9, max_size=9),
    where=st.lists(vertices, min_size=3, max_size=3, unique=True),
)
def test_any_coordinates_are_mended_or_refused(values, where) -> None:
    V = np.array(BALL.vertices)
    V[where] = np.array(values).reshape(3, 3)
    with np.errstate(all="raise"):
        mended_or_refused(V, BALL.faces)


def test_closing_a_hole_by_joining_two_vertices_is_refused_as_self_touching() -> None:
    V, F = np.array(BALL.vertices), np.array(BALL.faces)
    far = np.linalg.norm(V - V[0], axis=1).argmax()
    V[far] = V[0]
    with pytest.raises(MeshError, match="1 vertex where the surface touches itself"):
        Mesh.from_arrays(V, F)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e6])
def test_units_do_not_matter(animal: Atlas, scale: float) -> None:
    atlas = build_atlas(Mesh.from_arrays(animal.mesh.V * scale, animal.mesh.F), animal.resolution, cache=False)
    np.testing.assert_allclose(atlas.positions / scale, animal.positions, atol=1e-9)
    np.testing.assert_allclose(atlas.areas / scale**2, animal.areas, rtol=1e-6)
    lengths = {"edge_min", "edge_max"}
    for name, value in animal.quality().items():
        assert atlas.quality()[name] == pytest.approx(value * (scale if name in lengths else 1), rel=1e-6)


def test_place_does_not_matter(animal: Atlas) -> None:
    # far from the origin the vertices are rounded otherwise, and another turn of the cube may seem the best
    mesh = Mesh.from_arrays(animal.mesh.V + np.array([300.0, -20.0, 1.0]), animal.mesh.F)
    quality = build_atlas(mesh, animal.resolution, cache=False).quality()
    for name, value in animal.quality().items():
        assert quality[name] == pytest.approx(value, rel=0.25 if name in ("edge_min", "edge_max") else 0.05)


def with_degenerate_triangles(V: np.ndarray, F: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Split edges at a point on one of them, so that the triangles beyond get a corner on their own side: no area."""
    V, F = list(V), [list(f) for f in F]
    rng = np.random.default_rng(4)
    for k in rng.choice(len(F), count, replace=False):
        a, b, c = F[k]
        V.append((1 - 1e-3) * V[a] + 1e-3 * V[b])  # on the edge a-b: the triangle a, new, b has no area
        new = len(V) - 1
        F[k] = [new, b, c]
        F += [[a, new, c], [a, b, new]]
    return np.array(V), np.array(F)


def test_triangles_without_area_and_slivers_get_an_atlas() -> None:
    V, F = with_degenerate_triangles(*limbed(), count=40)
    mesh = Mesh.from_arrays(V, F)
    assert (mesh.triangle_areas < 1e-12 * mesh.area).sum() >= 40
    atlas = build_atlas(mesh, 32, cache=False)
    quality = atlas.quality()
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi)
    assert quality["coverage"] == pytest.approx(1, abs=0.05)
    assert np.isfinite(atlas.positions).all()
    assert np.isfinite(atlas.normals).all()
    assert np.isfinite(np.concatenate(atlas.locate(mesh.V))).all()


DIAGONALS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


def assert_touching(face, row, column, n: int) -> None:
    """Places of the directions to the cube's corners, edges and faces: in a face that touches them, on its border."""
    on = DIAGONALS[np.arange(26), face // 2]
    np.testing.assert_array_equal(on, 1 - 2 * (face % 2))
    offset = np.abs(np.stack([row, column]) - (n - 1) / 2)
    at_border, in_middle = np.isclose(offset, n / 2, atol=1e-6), np.isclose(offset, 0, atol=1e-6)
    np.testing.assert_array_equal(at_border.sum(axis=0), np.count_nonzero(DIAGONALS, axis=1) - 1)
    assert (at_border | in_middle).all()


def test_cube_edges_and_corners_are_located_on_the_sphere() -> None:
    atlas = sphere_atlas(2.0, 16)
    assert_touching(*atlas.locate(3 * DIAGONALS), 16)
    nearest = atlas.positions.reshape(-1, 3)[atlas.nearest_texel(DIAGONALS)]
    distance = np.linalg.norm(nearest - 2 * DIAGONALS / np.linalg.norm(DIAGONALS, axis=1, keepdims=True), axis=1)
    assert distance.max() < 2 * np.pi / 2 / 16  # a texel's width


def test_cube_edges_and_corners_are_located_on_a_mesh_with_vertices_there() -> None:
    box = trimesh.creation.box(extents=[2, 2, 2]).subdivide().subdivide()
    mesh = Mesh.from_arrays(box.vertices, box.faces)
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), 16)
    assert_touching(*atlas.locate(DIAGONALS), 16)


@quick
@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda d: np.linalg.norm(d) > 1e-3))
def test_located_points_lie_in_their_face(direction) -> None:
    mesh = Mesh.from_arrays(BALL.vertices, BALL.faces)
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), 8)
    _, [onto] = atlas.project(direction)
    face, row, column = (x[0] for x in atlas.locate(direction))
    a, b = np.tan(np.pi / 4 * ((2 * np.array([column, row]) + 1) / 8 - 1))
    back = CHART_NORMALS[face] + a * CHART_U[face] + b * CHART_V[face]
    np.testing.assert_allclose(back / np.linalg.norm(back), onto, atol=1e-12)
    assert max(abs(a), abs(b)) <= 1 + 1e-12


class TestRepair:
    """Mending with pymeshfix, which not everybody has."""

    @pytest.fixture(autouse=True)
    def _pymeshfix(self) -> None:
        pytest.importorskip("pymeshfix")

    @pytest.mark.parametrize("name", ["open", "non-manifold", "self-touching", "NaN", "two parts"])
    def test_a_damaged_ball_becomes_a_ball(self, name: str) -> None:
        V, F = np.array(BALL.vertices), np.array(BALL.faces)
        if name == "open":
            F = F[6:]
        elif name == "non-manifold":
            V, F = np.vstack([V, [[2.0, 0, 0]]]), np.vstack([F, [[F[0, 0], F[0, 1], len(V)]]])
        elif name == "self-touching":
            V[np.linalg.norm(V - V[0], axis=1).argmax()] = V[0]
        elif name == "NaN":
            V[3] = np.nan
        else:
            V, F = np.vstack([V, 0.1 * V + 5]), np.vstack([F, F + len(V)])
        with pytest.raises(MeshError) as refused:
            Mesh.from_arrays(V, F)
        mesh = repaired(V, F, "ball", refused.value)
        assert is_closed_sphere(mesh)
        assert mesh.volume == pytest.approx(BALL.volume, rel=0.4)
        assert mesh.fixes[0].startswith("repaired by pymeshfix")
        again = repaired(V, F, "ball", refused.value)
        np.testing.assert_array_equal(mesh.V, again.V)
        np.testing.assert_array_equal(mesh.F, again.F)

    def test_handles_stay_and_are_named(self) -> None:
        torus = trimesh.creation.torus(1.0, 0.3)
        with pytest.raises(MeshError, match=r"genus 1.*pymeshfix cannot"):
            repaired(np.array(torus.vertices), np.array(torus.faces), "ring", MeshError("ring is of genus 1"))

    def test_a_crash_of_pymeshfix_is_one_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        # the program that runs it is replaced by one that kills itself
        real = subprocess.run
        suicide = [sys.executable, "-c", "import os; os.abort()"]
        monkeypatch.setattr(subprocess, "run", lambda program, **options: real(suicide, **options))
        with pytest.raises(MeshError, match=r"open; pymeshfix cannot repair that \(it broke off\)$"):
            repaired(np.array(BALL.vertices), np.array(BALL.faces)[1:], "ball", MeshError("ball is open"))

    def test_what_is_hopeless_is_refused(self) -> None:
        with pytest.raises(MeshError, match="nothing is left"):
            repaired(np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "dust", MeshError("dust"))


def test_without_pymeshfix_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymeshfix", None)
    with pytest.raises(MeshError, match=r"open.*pip install 'ripple-sim\[repair\]'"):
        repaired(np.array(BALL.vertices), np.array(BALL.faces)[1:], "ball", MeshError("ball is open"))
