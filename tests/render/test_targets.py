"""Values that are written into the G-buffer are read back unchanged."""

import numpy as np
import pytest
from shader_functions import evaluated

from ripple_sim.render import GBuffer

FILE = "glsl/g_buffer.glsl"
BITS = 65535


def directions() -> np.ndarray:
    """Random unit vectors, and those on the folds of the octahedron."""
    free = np.random.default_rng(3).normal(size=(4000, 3))
    fold = free[:500] * [1, 1, 0]
    octants = np.array(
        [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z],
        float,
    )
    all_of_them = np.concatenate([free, fold, fold[:, [0, 2, 1]], fold[:, [2, 0, 1]], octants])
    return all_of_them / np.linalg.norm(all_of_them, axis=1, keepdims=True)


def test_octahedral_codes_fill_the_unit_square_and_directions_come_back(gl):
    """A step of a 16-bit code turns a normal by less than a hundredth of a degree."""
    given = directions()
    encode = "octahedral_encode(x.xyz)"
    code = evaluated(gl, FILE, f"vec4({encode}, 0.0, 0.0)", given)[:, :2]
    assert 0.0 <= code.min() <= code.max() <= 1.0
    filled, *_ = np.histogram2d(*code.T, bins=8, range=[[0, 1], [0, 1]])
    assert filled.min() > 0
    codes = encode, f"round({BITS}.0 * {encode}) / {BITS}.0"
    exact, rounded = (
        evaluated(gl, FILE, f"vec4(octahedral_decode({each}), 0.0)", given)[:, :3] for each in codes
    )
    np.testing.assert_allclose(exact, given, atol=2e-6)
    assert np.degrees(2 * np.arcsin(np.linalg.norm(rounded - given, axis=1).max() / 2)) < 0.01


def test_every_pair_of_bytes_comes_back_from_one_channel(gl):
    """All 65536 of them, after the channel has been rounded to its bits."""
    high, low = np.divmod(np.arange(BITS + 1), 256)
    given = np.stack([high, low], axis=1) / 255
    channel = f"round({BITS}.0 * pack_unorm8(x.x, x.y)) / {BITS}.0"
    back = evaluated(gl, FILE, f"vec4(unpack_unorm8({channel}), 0.0, 0.0)", given)[:, :2]
    np.testing.assert_array_equal(np.round(255 * back).astype(int), np.stack([high, low], axis=1))


@pytest.mark.parametrize("inner", [0, 1])
def test_every_packed_object_number_and_side_is_unpacked_unchanged(gl, inner):
    given = np.arange((BITS + 1) // 2)[:, None]
    channel = f"round({BITS}.0 * pack_object(x.x, {inner} == 1)) / {BITS}.0"
    unpacked = f"vec4(float(unpack_object({channel})), float(unpack_inner({channel})), 0.0, 0.0)"
    back = evaluated(gl, FILE, unpacked, given)
    np.testing.assert_array_equal(back[:, 0], given[:, 0])
    np.testing.assert_array_equal(back[:, 1], inner)


@pytest.mark.parametrize(("wanted", "got"), [(0, 1), (1, 1), (2, 2), (4, 4), (10_000, None)])
def test_there_are_as_many_samples_as_the_driver_has_and_at_least_one(gl, resources, wanted, got):
    with gl as ctx:
        most = ctx.max_samples
    assert GBuffer(resources, (4, 3), wanted).samples == (
        max(most, 1) if got is None else min(got, max(most, 1))
    )
