"""Whatever is given becomes a sound mesh or is refused, never anything else; and what must not matter does not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solids import BALL, is_closed_sphere
from sound import assert_sound, assert_unchanged_when_read_again

from ripple_sim.solver import Atlas, Mesh, MeshError, build_atlas

quick = settings(derandomize=True, max_examples=40, deadline=None, database=None)

faces = st.lists(st.integers(0, len(BALL.faces) - 1), max_size=6)

corners = st.lists(st.tuples(st.integers(0, len(BALL.faces) - 1), st.integers(0, 2)), max_size=3)

vertices = st.integers(0, len(BALL.vertices) - 1)


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
    rng = np.random.default_rng(seed)
    F = F[rng.permutation(len(F))]
    order = rng.permutation(len(BALL.vertices))
    mesh = mended_or_refused(np.array(BALL.vertices)[np.argsort(order)], order[F])
    assert mesh is not None
    assert is_closed_sphere(mesh)
    assert (len(mesh.V), len(mesh.F)) == (42, 80)
    assert mesh.volume == pytest.approx(BALL.volume)


@quick
@given(deleted=faces.filter(len), flipped=faces)
def test_deletions_leave_rims(deleted, flipped) -> None:
    F = np.array(BALL.faces)
    F[flipped] = F[flipped][:, ::-1]
    F = np.delete(F, deleted, axis=0)
    _, counts = np.unique(np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    mesh = mended_or_refused(np.array(BALL.vertices), F)
    assert mesh is not None
    assert not mesh.closed
    assert sum(map(len, mesh.rims)) == (counts == 1).sum()
    assert mesh.component_count > 1 or (np.einsum("ij,ij->i", mesh.vertex_normals, mesh.V) > 0).all()


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


def test_a_ball_that_touches_itself_is_cut_apart_there() -> None:
    V, F = np.array(BALL.vertices), np.array(BALL.faces)
    far = np.linalg.norm(V - V[0], axis=1).argmax()
    F = np.where(far == F, 0, F)
    V[far] = V[0]
    mesh = Mesh.from_arrays(V, F)
    assert is_closed_sphere(mesh)
    assert mesh.notes[-1] == "cut apart at 1 vertex where the surface touched itself"
    assert_unchanged_when_read_again(mesh)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
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
