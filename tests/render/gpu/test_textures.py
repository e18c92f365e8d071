"""Textures of sRGB pixels read as linear light, the right way up, and repeat."""

import numpy as np
import pytest

from ripple_sim.errors import RippleWarning
from ripple_sim.render.camera import srgb_to_linear
from ripple_sim.render.resources import fitted, srgb_cube, srgb_texture

SAMPLE = """#version 430
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Places { vec4 places[]; };
layout(std430, binding = 1) writeonly buffer Colors { vec4 colors[]; };
uniform SAMPLER image;
void main() {
    uint i = gl_GlobalInvocationID.x;
    colors[i] = textureLod(image, places[i].COORDINATES, places[i].w);
}
"""


def sampled(resources, texture, places, kind="2D") -> np.ndarray:
    """Colours [k, 3] at texture coordinates or directions, with the mipmap level as their fourth number."""
    source = SAMPLE.replace("SAMPLER", f"sampler{kind}").replace("COORDINATES", "xy" if kind == "2D" else "xyz")
    places = np.asarray(places, dtype=np.float32)
    with resources.gl as ctx:
        shader = ctx.compute_shader(source)
        given, got = ctx.buffer(places.tobytes()), ctx.buffer(reserve=places.nbytes)
        given.bind_to_storage_buffer(0)
        got.bind_to_storage_buffer(1)
        texture.use(0)
        shader.run(len(places))
        ctx.memory_barrier()
        return np.frombuffer(got.read(), np.float32).reshape(-1, 4)[:, :3]


def test_every_byte_reads_as_linear_light(resources):
    pixels = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    middles = [[(i + 0.5) / 256, 0.5, 0, 0] for i in range(256)]
    got = sampled(resources, srgb_texture(resources, pixels), middles)
    np.testing.assert_allclose(got, srgb_to_linear(pixels[0] / 255), atol=2e-3)


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (5, 7)])
def test_the_first_row_is_at_v_zero_and_the_picture_repeats(resources, size):
    """Also where rows are no multiple of four bytes."""
    height, width = size
    pixels = np.random.default_rng(1).integers(0, 256, (height, width, 3), dtype=np.uint8)
    texture = srgb_texture(resources, pixels)
    row, column = np.divmod(np.arange(height * width), width)
    places = np.stack([(column + 0.5) / width, (row + 0.5) / height, 0 * row, 0 * row], axis=1)
    expected = srgb_to_linear(pixels.reshape(-1, 3) / 255)
    for shift in ([0, 0, 0, 0], [1, 0, 0, 0], [-2, 3, 0, 0]):
        np.testing.assert_allclose(sampled(resources, texture, places + shift), expected, atol=0.01)


def test_small_pictures_of_a_texture_are_means_of_light_not_of_codes(resources):
    """Half black, half white: half the light, which is 188 in sRGB and not 128."""
    pixels = np.zeros((8, 8, 3), dtype=np.uint8)
    pixels[::2] = 255
    got = sampled(resources, srgb_texture(resources, pixels), [[0.3, 0.6, 0, 3]])
    np.testing.assert_allclose(got, 0.5, atol=0.01)


def test_faces_of_a_cube_lie_below_one_another(resources):
    """Right, left, up, down, front, back: along +x, -x, +y, -y, +z, -z."""
    faces = np.random.default_rng(2).integers(0, 256, (6, 3), dtype=np.uint8)
    pixels = np.repeat(faces, 16, axis=0).reshape(24, 4, 3)
    ways = np.concatenate([np.stack([axis, -axis]) for axis in np.eye(3)])
    got = sampled(resources, srgb_cube(resources, pixels), np.column_stack([ways, np.zeros(6)]), "Cube")
    np.testing.assert_allclose(got, srgb_to_linear(faces / 255), atol=0.01)


def test_a_texture_larger_than_the_drivers_largest_is_scaled_down_and_that_is_said(resources) -> None:
    with resources.gl as ctx:
        largest = ctx.info["GL_MAX_TEXTURE_SIZE"]
    pixels = np.zeros((2, largest + 100, 3), np.uint8)
    pixels[:, : largest // 2] = 200
    with pytest.warns(RippleWarning, match=rf"a texture of {largest + 100}x2 pixels is larger than the {largest}"):
        texture = srgb_texture(resources, pixels)
    assert texture.size == (largest, 2)


def test_scaling_keeps_colours_and_shape() -> None:
    pixels = np.zeros((40, 80, 3), np.uint8)
    pixels[:, :40] = (10, 100, 200)
    with pytest.warns(RippleWarning, match="scaled down to 20x10"):
        small = fitted(pixels, 20)
    assert small.shape == (10, 20, 3)
    assert (small[:, :10] == (10, 100, 200)).all()
    assert not small[:, 10:].any()
    assert fitted(pixels, 80) is pixels
