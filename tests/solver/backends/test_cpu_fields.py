"""Fields in memory: where texels and halo lie, and that loops read whole cache lines."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver.backends.cpu import LINE, PAGE, FieldLayout, aligned
from ripple_sim.solver.backends.kernels import fill

MESHES = [square(1), square(15), polygon(3, 6), polygon(5, 14), flat_torus(4), two_squares(7)]


@pytest.fixture(params=[False, True], ids=["side by side", "alone"])
def alone(request: pytest.FixtureRequest) -> bool:
    return request.param


def by_chart(rows: np.ndarray, charts: int, n: int) -> np.ndarray:
    """What lies in the rows of a field or a stencil's links, [C, ..., n + 2], and beyond the last chart."""
    if len(rows) == charts:
        return rows[..., : n + 2]
    beside = rows[0].reshape(*rows.shape[1:-1], charts + 1, n + 2)
    assert not beside[..., charts, :].any()
    return np.moveaxis(beside[..., :charts, :], -2, 0)


def place_in_page(view: np.ndarray) -> int:
    return view.ctypes.data // 4 % PAGE


@pytest.mark.parametrize("texels", MESHES, ids=lambda each: str(each.shape))
def test_addresses_are_those_of_the_texels_in_their_order(texels, alone: bool) -> None:
    layout = FieldLayout(texels.topology, alone=alone)
    field = layout.zeros()
    field.reshape(-1)[layout.addresses] = np.arange(1, texels.areas.size + 1)
    np.testing.assert_array_equal(layout.texels(field).ravel(), np.arange(1, texels.areas.size + 1))
    assert np.count_nonzero(field) == texels.areas.size


@pytest.mark.parametrize("texels", MESHES, ids=lambda each: str(each.shape))
def test_a_filled_halo_shows_the_texels_beyond_each_border(texels, alone: bool) -> None:
    layout, n = FieldLayout(texels.topology, alone=alone), texels.shape[1]
    field = layout.zeros()
    values = np.random.default_rng(0).standard_normal(texels.shape).astype(np.float32)
    layout.texels(field)[:] = values
    fill(field, layout.halo)
    np.testing.assert_array_equal(by_chart(field, len(values), n), texels.topology.with_halo(values))


@pytest.mark.parametrize("texels", MESHES, ids=lambda each: str(each.shape))
def test_coefficients_lie_beside_the_texels_of_a_field_and_are_0_between_charts(texels, alone: bool) -> None:
    layout = FieldLayout(texels.topology, alone=alone)
    values = np.arange(1, texels.areas.size + 1, dtype=np.float32).reshape(texels.shape)
    laid_out = layout.coefficients(values)
    np.testing.assert_array_equal(laid_out.reshape(-1)[layout.places], values.ravel())
    field = layout.zeros()
    field[:, 1:-1, 1 : layout.columns + 1] = laid_out
    np.testing.assert_array_equal(layout.texels(field), values)
    assert np.count_nonzero(laid_out) == values.size
    assert layout.coefficients(np.float32(3)) == 3


def test_what_loops_leave_beyond_a_fixed_rim_is_set_to_0_again() -> None:
    topology = polygon(3, 4).with_fixed_rim().topology
    layout = FieldLayout(topology)
    field = layout.zeros()
    field[:, 1:-1, 1 : layout.columns + 1] = 7
    fill(field, layout.halo)
    np.testing.assert_array_equal(by_chart(field, 3, 4), np.where(topology.rim | (topology.halo < 0), 0, np.float32(7)))


@pytest.mark.parametrize("texels", [polygon(3, 6), polygon(5, 14), square(3)], ids=lambda each: str(each.shape))
def test_irregular_links_join_the_texels_they_joined(texels, alone: bool) -> None:
    layout = FieldLayout(texels.topology, alone=alone)
    stencil = texels.stencil(np.ones(texels.shape))
    weights = layout.weights(stencil)
    n = texels.shape[1]
    np.testing.assert_array_equal(
        by_chart(weights.rows, len(texels.areas), n)[..., : n + 1], stencil.weights.astype(np.float32)
    )
    links = weights.irregular
    if stencil.irregular is None:
        assert len(links.texels) == len(links.others) == 0 and links.begins.tolist() == [0]
        return
    assert len(links.texels) > 0
    number = np.full(layout.zeros().size, -1)
    number[layout.addresses] = np.arange(texels.areas.size)
    np.testing.assert_array_equal(number[links.addresses], stencil.irregular.texels)
    np.testing.assert_array_equal(links.texels, layout.places[stencil.irregular.texels])
    np.testing.assert_array_equal(number[links.others], stencil.irregular.others)


@pytest.mark.parametrize("n", [1, 14, 15, 30])
def test_every_row_of_texels_begins_a_cache_line(n: int) -> None:
    field = FieldLayout(square(n).topology).zeros()
    for r in range(1, n + 1):
        assert place_in_page(field[0, r, 1:]) % LINE == 0
    assert field.flags.c_contiguous and field.shape[2] >= n + 2


@pytest.mark.parametrize("shift", [0, LINE, 10 * LINE])
@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("shape", [(1, 3, 16), (6, 10, 32)])
def test_aligned_memory_begins_where_it_was_asked_to(shape: tuple[int, ...], column: int, shift: int) -> None:
    for _ in range(3):
        field = aligned(shape, column, shift)
        assert field.shape == shape and not field.any()
        assert place_in_page(field[0, 0, column:]) == shift
        field[:] = 1  # all of it can be written
