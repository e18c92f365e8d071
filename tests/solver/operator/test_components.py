"""Freely floating parts of a surface."""

import numpy as np
import pytest
from hand_made import square, two_squares

from ripple_sim.solver import Material, TexelMesh, texel_atlas
from ripple_sim.solver.operator.assembly import build_operator


def parts(texels: TexelMesh, **coefficients: object) -> np.ndarray | None:
    return build_operator(texel_atlas(texels), Material(**coefficients), "fem").parts


def columns(*values: float) -> np.ndarray:
    """A field of the square whose columns have the given values, 12 in all."""
    return np.broadcast_to(np.repeat(values, 12 // len(values)), (1, 12, 12)).copy()


@pytest.mark.parametrize("coefficients", [{}, {"speed": 0.0, "bending": 1.0}, {"speed": columns(1, 2, 3)}])
def test_a_surface_in_one_piece_has_no_parts(coefficients: dict) -> None:
    assert parts(square(12), **coefficients) is None


def test_the_parts_of_a_mesh_are_parts() -> None:
    found = parts(two_squares(4))
    assert found is not None and found.dtype == np.int32
    assert (found[0] == 0).all() and (found[1] == 1).all()


def test_rigid_texels_cut_a_surface_up() -> None:
    found = parts(square(12), speed=columns(1, 1, 0, 1))
    assert found is not None
    assert (found[0, :, :6] == 0).all() and (found[0, :, 9:] == 1).all()


def test_what_springs_or_a_clamp_hold_is_one_part() -> None:
    speed = columns(1, 1, 0, 1)
    assert parts(square(12), speed=speed, stiffness=5.0) is None
    held_left = columns(1, 0, 0, 0) > 0
    found = parts(square(12), speed=speed, fixed=held_left)
    assert found is not None
    assert len(np.unique(found[0, :, 9:])) == 1 and found[0, 0, 4] != found[0, 0, 10]
    # a clamp does not cut, unless it is all that there is in between
    assert parts(square(12), fixed=columns(0, 0, 1, 0) > 0) is None


def test_a_plate_holds_together_where_it_bends() -> None:
    found = parts(square(12), speed=0.0, bending=columns(1, 1, 0, 1))
    assert found is not None and found[0, 0, 0] != found[0, 0, 11]
