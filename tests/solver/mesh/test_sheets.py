"""Where sheets touch: bodies stay bodies, floors stay floors, and what stands on them comes off."""

from __future__ import annotations

import numpy as np
import pytest
from all_kinds import voxels
from solids import BALL, cube
from sound import assert_sound, assert_unchanged_when_read_again

from ripple_sim.solver import Mesh

TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.5, 0.3, 0.8]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
)


def merged(*bodies: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Several bodies, equal positions being one vertex."""
    V = np.vstack([V for V, _ in bodies])
    first = np.cumsum([0, *(len(V) for V, _ in bodies)])
    F = np.vstack([F + at for (_, F), at in zip(bodies, first, strict=False)])
    V, number = np.unique(V.round(9), axis=0, return_inverse=True)
    return V, number.ravel()[F]


def square(*corners: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.array(corners, dtype=float), np.array([[0, 1, 2], [0, 2, 3]])


def sound(V: np.ndarray, F: np.ndarray) -> Mesh:
    mesh = Mesh.from_arrays(V, F)
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    return mesh


@pytest.mark.parametrize("wound", ["outwards", "inwards", "at random"])
@pytest.mark.parametrize("loose", [False, True])
@pytest.mark.parametrize(
    ("bodies", "volume"),
    [
        (((cube()[0], cube()[1]), (cube()[0] + [1, 1, 0], cube()[1])), 2.0),
        ((TETRAHEDRON, (TETRAHEDRON[0] * [1, -1, -1], TETRAHEDRON[1][:, ::-1])), 0.24),
        (((cube()[0], cube()[1]), (cube()[0] + 1, cube()[1])), 2.0),
    ],
    ids=["cubes at an edge", "tetrahedra at an edge", "cubes at a corner"],
)
def test_two_bodies_that_touch_stay_two(bodies, volume: float, loose: bool, wound: str) -> None:
    V, F = merged(*bodies)
    if wound == "inwards":
        F = F[:, ::-1]
    elif wound == "at random":
        turned = np.random.default_rng(1).random(len(F)) < 0.5
        F = np.where(turned[:, None], F[:, ::-1], F)
    if loose:
        V, F = V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3)
    mesh = sound(V, F)
    assert mesh.closed
    assert mesh.component_count == 2
    assert mesh.genus.tolist() == [0, 0]
    assert mesh.volume == pytest.approx(volume)
    assert any(note.startswith("cut apart") for note in mesh.notes)


def test_a_wall_comes_off_the_floor_on_which_it_stands() -> None:
    left, right = square((0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0)), square((1, 0, 0), (2, 0, 0), (2, 2, 0), (1, 2, 0))
    wall = square((1, 0, 0), (1, 2, 0), (1, 2, 1), (1, 0, 1))
    mesh = sound(*merged(left, right, wall))
    assert mesh.component_count == 2
    floor = np.flatnonzero((mesh.V[mesh.F][..., 2] == 0).all(axis=1))
    assert len(np.unique(mesh.components[floor])) == 1
    assert mesh.notes == ("cut apart along 1 edge where more than two triangles met",)


def test_an_inner_wall_comes_off_its_box() -> None:
    V, F = cube()
    half = V * [0.5, 1, 1] + [0.25, 0, 0]
    mesh = sound(*merged((half, F), (half * [-1, 1, 1], F[:, ::-1])))
    # the wall is there twice, and once is enough
    assert mesh.component_count == 2
    assert mesh.volume == pytest.approx(1)
    assert [len(rim) for rim in mesh.rims] == [4]
    assert any("repeated" in note for note in mesh.notes)


def test_a_fin_comes_off_and_the_ball_stays_closed() -> None:
    V, F = np.array(BALL.vertices), np.array(BALL.faces)
    a, b = F[0, :2]
    mesh = sound(np.vstack([V, 2 * V[a]]), np.vstack([[[a, b, len(V)]], F]))
    assert mesh.component_count == 2
    assert mesh.volume == pytest.approx(BALL.volume)
    assert [len(rim) for rim in mesh.rims] == [3]


def test_a_bag_that_is_pinched_along_an_edge_becomes_manifold_though_no_vertex_can_tell() -> None:
    # a ring of cells round an empty one: four triangles meet along the edge, joined elsewhere on both sides of it
    cells = np.ones((2, 2, 2), dtype=bool)
    cells[0, 0, 0] = cells[1, 1, 0] = False
    mesh = sound(*voxels(cells))
    assert mesh.closed
    assert mesh.component_count == 1
    assert mesh.volume == pytest.approx(6)


def test_the_vertices_of_a_cut_stand_where_the_one_stood() -> None:
    V, F = merged((cube()[0], cube()[1]), (cube()[0] + 1, cube()[1]))
    mesh = sound(V, F)
    places, first = np.unique(mesh.V, axis=0, return_index=True)
    np.testing.assert_array_equal(places, V)
    assert len(mesh.V) == len(V) + 1
    assert (np.diff(first) >= 1).all()
