"""Parts, rims and handles of a mesh, and what no mesh can be made of."""

import numpy as np
import pytest
from solids import cube, torus

from ripple_sim.solver import Mesh, MeshError


@pytest.mark.parametrize(
    ("damage", "name"),
    [
        (lambda V, F: (np.where(np.arange(8)[:, None] == 2, np.nan, V), F), "NaN"),
        (lambda V, F: (V, F + 1), "indices run from"),
        (lambda V, F: (V, F[:1, [0, 1, 1]]), "no triangle with an area"),
        (lambda V, F: (V * [1, 0, 0], F), "no triangle with an area"),
        (lambda V, F: (V * 1e15, F), "size is 1e"),
        (lambda V, F: (V, F * 1.5), "integers"),
        (lambda V, F: (V, F[:0]), "m > 0"),
    ],
)
def test_what_is_no_surface_is_refused_by_name(damage, name: str) -> None:
    with pytest.raises(MeshError, match=name):
        Mesh.from_arrays(*damage(*cube()))


def test_a_cube_without_a_triangle_has_one_rim_to_the_left_of_which_it_lies() -> None:
    V, F = cube()
    mesh = Mesh.from_arrays(V, F[1:])
    assert not mesh.closed
    [rim] = mesh.rims
    assert rim[0] == rim.min()
    # the missing triangle runs round the hole the other way
    assert sorted(rim.tolist()) == sorted(F[0].tolist())
    at = rim.tolist().index(F[0, 0])
    assert rim[at - 1] == F[0, 1]
    assert mesh.genus.tolist() == [0]
    assert mesh.volume == 0


def test_parts_are_numbered_by_their_first_triangles() -> None:
    V, F = cube()
    mixed = np.vstack([F + 8, F])[np.random.default_rng(0).permutation(24)]
    mesh = Mesh.from_arrays(np.vstack([V, 0.5 * V + 3]), mixed)
    assert mesh.component_count == 2
    assert mesh.components[0] == 0
    assert np.array_equal(mesh.components == mesh.components[0], (mesh.F < 8).all(axis=1) == (mesh.F[0] < 8).all())
    assert mesh.volume == pytest.approx(1 + 0.125)
    assert mesh.genus.tolist() == [0, 0]


def test_handles_are_counted_part_by_part_with_and_without_rims() -> None:
    ring_V, ring_F = torus()
    V, F = cube()
    mesh = Mesh.from_arrays(np.vstack([ring_V, V + 5]), np.vstack([ring_F[3:], F + len(ring_V)]))
    assert mesh.genus.tolist() == [1, 0]
    assert len(mesh.rims) == 1
