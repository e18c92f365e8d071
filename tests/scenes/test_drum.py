"""The drum's meshes: a flat skin with one rim, a wall under it, and the same whenever they are made again."""

import igl
import numpy as np
import pytest

from ripple_sim.scenes import drum


def test_skin_is_a_flat_disk_of_even_triangles_that_faces_up() -> None:
    V, F = drum.skin()
    a, b, c = (V[F[:, k]] for k in range(3))
    upwards = np.cross(b - a, c - a)[:, 2]
    assert upwards.min() > 0
    assert upwards.sum() / 2 == pytest.approx(np.pi * drum.RADIUS**2, rel=1e-3)
    assert igl.euler_characteristic(F) == 1
    assert np.degrees(igl.internal_angles(V, F)).min() > 40
    np.testing.assert_array_equal(V[:, 2], drum.HEIGHT)


def test_the_wall_is_a_closed_tube_that_faces_outwards_and_stands_on_the_floor() -> None:
    V, F = drum.wall()
    assert len(igl.boundary_facets(F)[0]) == 0
    assert igl.euler_characteristic(F) == 0
    assert np.linalg.det(V[F]).sum() > 0
    assert V[:, 2].min() == 0


@pytest.mark.parametrize("made", [drum.skin, drum.wall])
def test_shipped_meshes_are_what_the_module_makes(made) -> None:
    V, F = made()
    path = drum.SKIN_FILE if made is drum.skin else drum.WALL_FILE
    shipped_V, _, _, shipped_F, *_ = igl.readOBJ(str(path))
    np.testing.assert_array_equal(shipped_F, F)
    np.testing.assert_allclose(shipped_V, V, rtol=1e-4, atol=1e-6)
