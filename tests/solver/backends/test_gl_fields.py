"""Fields in storage buffers: strips, their halo, links and lists."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver import TexelMesh
from ripple_sim.solver.backends.gl_fields import EIGHT, FieldLayout, LinkBuffers, TexelList
from ripple_sim.solver.gl import shared_context

pytestmark = pytest.mark.usefixtures("opengl")

# charts of one strip and of several, that fill their last eight and that do not
MESHES = [square(1), square(7), square(64), square(65), flat_torus(130), polygon(3, 9), polygon(5, 8), two_squares(3)]
NAMES = [str(each.shape) for each in MESHES]


def numbers(texels: TexelMesh) -> np.ndarray:
    return np.arange(1, texels.areas.size + 1, dtype=np.float32).reshape(texels.shape)


def floats(buffer) -> np.ndarray:
    with shared_context():
        return np.frombuffer(buffer.read(), np.float32).copy()


def integers(buffer) -> np.ndarray:
    with shared_context():
        return np.frombuffer(buffer.read(), np.int32).copy()


@pytest.mark.parametrize("texels", MESHES, ids=NAMES)
def test_a_field_comes_back_as_it_was_uploaded_or_written(texels: TexelMesh) -> None:
    layout = FieldLayout(shared_context(), texels.topology)
    field = numbers(texels)
    buffer = layout.upload(field)
    np.testing.assert_array_equal(layout.read(buffer), field)
    layout.write(buffer, -field)
    np.testing.assert_array_equal(layout.read(buffer), -field)
    assert not layout.read(layout.zeros()).any()
    assert layout.strips * layout.width >= texels.shape[0] * layout.n
    assert layout.width % EIGHT == layout.stride % EIGHT == 0


@pytest.mark.parametrize("texels", MESHES, ids=NAMES)
def test_texels_lie_at_their_addresses_and_zeros_round_them(texels: TexelMesh) -> None:
    layout = FieldLayout(shared_context(), texels.topology)
    places = floats(layout.upload(numbers(texels)))
    assert len(places) == EIGHT * layout.eights
    np.testing.assert_array_equal(places[layout.texels], numbers(texels).ravel())
    assert np.count_nonzero(places) == texels.areas.size


@pytest.mark.parametrize("texels", MESHES, ids=NAMES)
def test_filled_strips_show_what_lies_round_every_texel(texels: TexelMesh) -> None:
    layout, n = FieldLayout(shared_context(), texels.topology), texels.shape[1]
    places = floats(layout.upload(numbers(texels)))
    pairs = integers(layout.halo_pairs).reshape(-1, 2)
    assert len(pairs) == layout.halo_count
    assert len(np.unique(pairs[:, 0])) == len(pairs)
    assert not np.isin(pairs[:, 0], layout.texels).any() and np.isin(pairs[:, 1], layout.texels).all()
    places[pairs[:, 0]] = places[pairs[:, 1]]
    around = texels.topology.with_halo(numbers(texels))
    address = layout.texels.reshape(texels.shape)
    for r, c in np.ndindex(3, 3):
        seen = places[address + (r - 1) * layout.stride + c - 1]
        np.testing.assert_array_equal(seen, around[:, r : r + n, c : c + n])


def test_numbers_and_fields_are_uploaded_one_after_the_other() -> None:
    texels = polygon(3, 9)
    layout = FieldLayout(shared_context(), texels.topology)
    places = floats(layout.upload(numbers(texels), np.float32(0.5), 2 * numbers(texels))).reshape(3, -1)
    expected = [numbers(texels).ravel(), np.full(texels.areas.size, 0.5), 2 * numbers(texels).ravel()]
    np.testing.assert_array_equal(places[:, layout.texels], expected)


@pytest.mark.parametrize("texels", [square(65), polygon(5, 8)], ids=lambda each: str(each.shape))
def test_links_stand_side_by_side_at_the_place_where_they_start(texels: TexelMesh) -> None:
    layout, n = FieldLayout(shared_context(), texels.topology), texels.shape[1]
    stencil = texels.stencil(np.ones(texels.shape))
    places = floats(layout.upload_stencil(stencil)).reshape(-1, 4)
    address = layout.texels.reshape(texels.shape)
    for r, c in np.ndindex(2, 2):  # the links of a texel, and of the places south and west of it; one column further on
        links = places[address - r * layout.stride - c + 1]
        expected = stencil.weights[:, :, 1 - r : n + 1 - r, 1 - c : n + 1 - c]
        np.testing.assert_array_equal(links[:, :, : layout.width - 1], np.moveaxis(expected, 1, -1).astype(np.float32)[
            :, :, : layout.width - 1
        ])  # fmt: skip


@pytest.mark.parametrize("texels", [polygon(5, 8), square(4)], ids=lambda each: str(each.shape))
def test_irregular_links_are_scaled_by_the_factor_of_their_texel(texels: TexelMesh) -> None:
    layout = FieldLayout(shared_context(), texels.topology)
    stencil, factors = texels.stencil(np.ones(texels.shape)), numbers(texels)
    buffers = LinkBuffers(shared_context(), layout, stencil.irregular, factors)
    if stencil.irregular is None:
        assert buffers.count == 0
        return
    texel, first, last = integers(buffers.texels).reshape(-1, 3).T
    np.testing.assert_array_equal(texel, layout.texels[stencil.irregular.texels])
    assert buffers.count == len(texel) > 0
    other, bits = integers(buffers.links).reshape(-1, 2).T
    np.testing.assert_array_equal(other, layout.texels[stencil.irregular.others])
    weights = np.ascontiguousarray(bits).view(np.float32)
    for i, (a, b) in enumerate(zip(first, last, strict=True)):
        factor = factors.ravel()[stencil.irregular.texels[i]]
        np.testing.assert_allclose(weights[a:b], factor * stencil.irregular.weights[a:b], rtol=1e-6)
    assert first[0] == 0 and last[-1] == len(other) and (first[1:] == last[:-1]).all()


def test_a_list_grows_when_it_must_and_may_be_empty() -> None:
    entries = TexelList(shared_context())
    assert entries.count == 0
    for count in (3, 1024, 1025, 5000, 2, 0):
        places, values = np.arange(count) + 7, np.linspace(0, 1, count)
        entries.set(places, values)
        assert entries.count == count
        np.testing.assert_array_equal(integers(entries.places)[:count], places)
        np.testing.assert_array_equal(floats(entries.values)[:count], values.astype(np.float32))
