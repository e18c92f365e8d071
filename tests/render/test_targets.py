"""What is written into the G-buffer is what is read from it."""

import moderngl
import numpy as np
import pytest
from shader_functions import evaluated

from ripple_sim.render.targets import GBuffer

FILE = "glsl/g_buffer.glsl"
BITS = 65535


def directions() -> np.ndarray:
    """Random unit vectors, and those on the folds of the octahedron."""
    free = np.random.default_rng(3).normal(size=(4000, 3))
    fold = free[:500] * [1, 1, 0]
    octants = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float)
    all_of_them = np.concatenate([free, fold, fold[:, [0, 2, 1]], fold[:, [2, 0, 1]], octants])
    return all_of_them / np.linalg.norm(all_of_them, axis=1, keepdims=True)


def test_a_direction_comes_back_from_its_octahedral_encoding(gl):
    given = directions()
    back = evaluated(gl, FILE, "vec4(octahedral_decode(octahedral_encode(x.xyz)), 0.0)", given)[:, :3]
    np.testing.assert_allclose(back, given, atol=2e-6)


def test_sixteen_bits_are_enough_for_a_normal(gl):
    """A step of the code turns a normal by less than a hundredth of a degree."""
    given = directions()
    code = f"round({BITS}.0 * octahedral_encode(x.xyz)) / {BITS}.0"
    back = evaluated(gl, FILE, f"vec4(octahedral_decode({code}), 0.0)", given)[:, :3]
    chord = np.linalg.norm(back - given, axis=1)
    assert np.degrees(2 * np.arcsin(chord.max() / 2)) < 0.01


def test_octahedral_codes_fill_the_unit_square_and_no_more(gl):
    code = evaluated(gl, FILE, "vec4(octahedral_encode(x.xyz), 0.0, 0.0)", directions())[:, :2]
    assert code.min() >= 0.0
    assert code.max() <= 1.0
    upper, *_ = np.histogram2d(*code.T, bins=8, range=[[0, 1], [0, 1]])
    assert upper.min() > 0
    # the poles: the middle of the square and its corners
    poles = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    middle, corner = evaluated(gl, FILE, "vec4(octahedral_encode(x.xyz), 0.0, 0.0)", poles)[:, :2]
    np.testing.assert_allclose(middle, 0.5)
    np.testing.assert_allclose(np.abs(corner - 0.5), 0.5)


def test_every_pair_of_bytes_comes_back_from_one_channel(gl):
    """All 65536 of them, after the channel has been rounded to its bits."""
    high, low = np.divmod(np.arange(BITS + 1), 256)
    given = np.stack([high, low], axis=1) / 255
    channel = f"round({BITS}.0 * pack_unorm8(x.x, x.y)) / {BITS}.0"
    back = evaluated(gl, FILE, f"vec4(unpack_unorm8({channel}), 0.0, 0.0)", given)[:, :2]
    np.testing.assert_array_equal(np.round(255 * back).astype(int), np.stack([high, low], axis=1))


def test_values_beyond_zero_to_one_are_packed_as_the_nearest(gl):
    given = np.array([[-0.5, 2.0], [1.5, -1e-3], [1.0, 1.0], [0.499 / 255, 0.501 / 255]])
    back = evaluated(gl, FILE, "vec4(unpack_unorm8(pack_unorm8(x.x, x.y)), 0.0, 0.0)", given)[:, :2]
    np.testing.assert_allclose(255 * back, [[0, 255], [255, 0], [255, 255], [0, 1]], atol=1e-4)


@pytest.mark.parametrize("inner", [0, 1])
def test_every_number_of_an_object_comes_back_with_its_side(gl, inner):
    given = np.arange((BITS + 1) // 2)[:, None]
    channel = f"round({BITS}.0 * pack_object(x.x, {inner} == 1)) / {BITS}.0"
    back = evaluated(
        gl, FILE, f"vec4(float(unpack_object({channel})), float(unpack_inner({channel})), 0.0, 0.0)", given
    )
    np.testing.assert_array_equal(back[:, 0], given[:, 0])
    np.testing.assert_array_equal(back[:, 1], inner)


@pytest.mark.parametrize(("wanted", "got"), [(0, 1), (1, 1), (2, 2), (4, 4), (10_000, None)])
def test_there_are_as_many_samples_as_the_driver_has_and_at_least_one(gl, resources, wanted, got):
    with gl as ctx:
        most = ctx.max_samples
    assert GBuffer(resources, (4, 3), wanted).samples == (max(most, 1) if got is None else min(got, max(most, 1)))


@pytest.mark.parametrize("samples", [1, 4])
def test_clearing_forgets_depths_and_lets_colours_be_written_again(gl, resources, samples):
    """A triangle at depth 0.5 is drawn, forgotten, and drawn again: depth test and colour masks are as before."""
    buffer = GBuffer(resources, (8, 4), samples)
    with gl as ctx:
        program = ctx.program(
            vertex_shader="""#version 430
            void main() { gl_Position = vec4(4.0 * vec2(gl_VertexID == 1, gl_VertexID == 2) - 1.0, 0.0, 1.0); }""",
            fragment_shader="""#version 430
            layout(location = 0) out vec4 a; layout(location = 1) out vec4 b; uniform vec4 shade;
            void main() { a = shade; b = shade; }""",
        )
        triangle = ctx.vertex_array(program, [])
        buffer.use(ctx)
        ctx.depth_func = "<"
        for shade in (0.25, 0.75):  # the second is behind nothing only if the first was forgotten
            buffer.clear()
            program["shade"] = (shade,) * 4
            triangle.render(moderngl.TRIANGLES, vertices=3)
        plain = [ctx.texture((8, 4), 4, dtype="nu2") for _ in range(2)]
        for index, texture in enumerate(plain):
            source = buffer._framebuffer.color_attachments[index]
            into, origin = ctx.framebuffer([texture]), ctx.framebuffer([source])
            ctx.copy_framebuffer(into, origin)
            values = np.frombuffer(texture.read(), dtype=np.uint16)
            np.testing.assert_allclose(values / BITS, 0.75, atol=2e-5)
        ctx.depth_func = "<="
        ctx.detect_framebuffer(0).use()
