"""Fields, links and lists in storage buffers, and compute shaders over them, against numpy."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver import TexelMesh
from ripple_sim.solver.backends.gl_dispatch import Dispatch
from ripple_sim.solver.backends.gl_fields import FieldLayout, LinkBuffers, TexelList
from ripple_sim.solver.gl import shared_context

pytestmark = pytest.mark.usefixtures("opengl")

MESHES = [square(1), square(66), flat_torus(17), polygon(3, 9), two_squares(3)]


@pytest.fixture(params=MESHES, ids=lambda each: str(each.shape))
def texels(request: pytest.FixtureRequest) -> TexelMesh:
    return request.param


def numbers(texels: TexelMesh) -> np.ndarray:
    return np.arange(1, texels.areas.size + 1, dtype=np.float32).reshape(texels.shape)


def floats(buffer) -> np.ndarray:
    with shared_context():
        return np.frombuffer(buffer.read(), np.float32).copy()


def integers(buffer) -> np.ndarray:
    with shared_context():
        return np.frombuffer(buffer.read(), np.int32).copy()


def field(texels: TexelMesh, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(texels.shape).astype(np.float32)


def test_a_field_comes_back_as_it_was_uploaded_or_written(texels: TexelMesh) -> None:
    layout, values = FieldLayout(shared_context(), texels.topology), numbers(texels)
    buffer = layout.upload(values, np.float32(0.5))
    first, second = floats(buffer).reshape(2, -1)
    for places, expected in ((first, values.ravel()), (second, np.full(values.size, 0.5))):
        np.testing.assert_array_equal(places[layout.texels], expected)
        assert np.count_nonzero(places) == values.size, "zeros round the texels"
    buffer = layout.zeros()
    layout.write(buffer, -values)
    np.testing.assert_array_equal(layout.read(buffer), -values)


def test_a_filled_halo_shows_what_lies_round_every_texel(texels: TexelMesh) -> None:
    gl, n = shared_context(), texels.shape[1]
    layout = FieldLayout(gl, texels.topology)
    buffer = layout.upload(numbers(texels))
    with gl:
        Dispatch(gl, layout).fill_halo(buffer)
    around = texels.topology.with_halo(numbers(texels))
    address = layout.texels.reshape(texels.shape)
    for r, c in np.ndindex(3, 3):
        seen = floats(buffer)[address + (r - 1) * (n + 2) + c - 1]
        np.testing.assert_array_equal(seen, around[:, r : r + n, c : c + n])


@pytest.mark.parametrize("defines", [{}, {"FACTOR": 1}, {"SUBTRACT": 1}, {"SUBTRACT": 1, "ADD": 1}], ids=str)
def test_the_stencil_is_applied_to_every_texel_once(texels: TexelMesh, defines: dict[str, int]) -> None:
    gl = shared_context()
    layout = FieldLayout(gl, texels.topology)
    dispatch = Dispatch(gl, layout)
    x, factor, before = (field(texels, seed) for seed in range(3))
    stencil = texels.stencil(np.ones(texels.shape))
    with gl:
        buffer, result = layout.upload(x), layout.upload(before)
        dispatch.fill_halo(buffer)
        dispatch.bind(buffer, result, None, layout.upload_stencil(stencil), layout.upload(factor))
        dispatch.run_texels(dispatch.texel_shader("apply", **defines))
        irregular = dispatch.shader("irregular", KICK=0)
        scale = (factor if "FACTOR" in defines else 1) * (-1 if "SUBTRACT" in defines else 1) * np.ones(texels.shape)
        links = LinkBuffers(gl, layout, stencil.irregular, scale)
        if links.count:
            dispatch.bind(buffer, result, None, links.texels, links.links)
            dispatch.run_list(irregular, links.count)
    assert links.count == (0 if stencil.irregular is None else len(stencil.irregular.texels))
    expected = scale * stencil(x.astype(float)) + (before if "ADD" in defines else 0)
    np.testing.assert_allclose(layout.read(result), expected, atol=2e-5 * max(1, np.abs(expected).max()))


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_a_list_is_run_to_its_last_entry_and_not_beyond(count: int) -> None:
    gl, texels = shared_context(), square(15)
    layout = FieldLayout(gl, texels.topology)
    dispatch = Dispatch(gl, layout)
    h, v = field(texels, 3), field(texels, 4)
    kicks = np.random.default_rng(5).standard_normal(225).astype(np.float32)
    with gl as ctx:
        height, velocity = layout.upload(h), layout.upload(v)
        places = ctx.buffer(layout.texels.astype(np.int32).tobytes())
        shader = dispatch.shader("kick")
        shader["dt"] = 0.5
        dispatch.bind(height, velocity, places, ctx.buffer(kicks.tobytes()))
        dispatch.run_list(shader, count)
    kicks[count:] = 0
    np.testing.assert_allclose(layout.read(velocity).ravel(), v.ravel() + kicks, rtol=1e-6)
    np.testing.assert_allclose(layout.read(height).ravel(), h.ravel() + 0.5 * kicks, rtol=1e-5, atol=1e-6)


def test_a_list_grows_when_it_must_and_may_be_empty() -> None:
    entries = TexelList(shared_context())
    assert entries.count == 0
    for count in (3, 1024, 1025, 5000, 2, 0):
        places, values = np.arange(count) + 7, np.linspace(0, 1, count)
        entries.set(places, values)
        assert entries.count == count
        np.testing.assert_array_equal(integers(entries.places)[:count], places)
        np.testing.assert_array_equal(floats(entries.values)[:count], values.astype(np.float32))
