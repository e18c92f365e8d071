"""Tone mapping: darker light stays darker, greys stay grey, and dim light keeps its colour."""

import numpy as np
import pytest
from shader_functions import evaluated

from ripple_sim.render import linear_to_srgb, srgb_to_linear, tone_mapped

FILE = "glsl/tone_mapping.glsl"
SHOULDER = 0.72


def mapped(gl, radiance, linear=0):
    return evaluated(
        gl, FILE, "vec4(tone_mapped(x.rgb), 1.0)", np.asarray(radiance, dtype=float), LINEAR=linear
    )[:, :3]


def test_the_shader_and_numpy_agree(gl):
    rng = np.random.default_rng(1)
    radiance = rng.uniform(0, 1, (4000, 3)) * np.geomspace(1e-3, 1e3, 4000)[:, None]
    np.testing.assert_allclose(mapped(gl, radiance), tone_mapped(radiance), atol=2e-5)


def test_below_the_shoulder_it_is_the_srgb_curve(gl):
    rng = np.random.default_rng(0)
    radiance = np.concatenate(
        [rng.uniform(0, SHOULDER, (1000, 3)), rng.uniform(0, 0.01, (200, 3)), np.zeros((1, 3))]
    )
    np.testing.assert_allclose(mapped(gl, radiance), linear_to_srgb(radiance), atol=2e-5)


@pytest.mark.parametrize("hue", [(1, 1, 1), (1, 0.3, 0.1), (0, 0, 1), (0.2, 1, 0.9)])
def test_brighter_light_is_nowhere_darker(gl, hue):
    """Along a hue no channel falls, whatever the exposure; nothing leaves 0 to 1."""
    strength = np.geomspace(1e-4, 1e4, 3000)
    shown = mapped(gl, strength[:, None] * np.array(hue))
    assert np.diff(shown, axis=0).min() > -1e-6
    assert -1e-6 <= shown.min() <= shown.max() <= 1 + 1e-5
    assert (np.diff(shown.max(axis=1)[strength < 30]) > 0).all()


def test_there_is_no_step_at_the_shoulder(gl):
    """Neither in brightness nor in contrast."""
    strength = SHOULDER + np.linspace(-0.02, 0.02, 401)
    grey = srgb_to_linear(mapped(gl, np.repeat(strength[:, None], 3, axis=1)))[:, 0]
    slope = (
        np.polyfit(strength[:190], grey[:190], 1)[0],
        np.polyfit(strength[210:], grey[210:], 1)[0],
    )
    assert np.abs(np.diff(grey)).max() < 1.2e-4
    assert slope[0] == pytest.approx(1.0, abs=1e-3)
    assert 0.85 < slope[1] < 1.0


def test_greys_stay_grey_and_very_bright_colours_turn_white(gl):
    grey = mapped(gl, np.repeat(np.geomspace(1e-3, 1e3, 200)[:, None], 3, axis=1))
    np.testing.assert_allclose(np.ptp(grey, axis=1), 0.0, atol=1e-6)
    dim, bright, glaring = mapped(gl, np.array([[1, 0.2, 0.1]]) * [[0.5], [20], [1e4]])
    assert np.ptp(dim) > np.ptp(bright) > np.ptp(glaring)
    assert glaring.min() > 0.95


def test_frames_of_linear_light_keep_it_as_far_as_half_floats_reach(gl):
    radiance = np.array([[0.5, 3.0, 60_000.0], [-0.1, 0.0, 1e9]])
    shown = mapped(gl, radiance, linear=1)
    np.testing.assert_allclose(shown, [[0.5, 3.0, 60_000.0], [0.0, 0.0, 65_504.0]])
    assert np.isfinite(shown.astype(np.float16)).all()


def test_dithering_moves_a_colour_by_half_a_code_at_most_and_by_nothing_on_average(gl):
    """The values around a pixel round to codes whose mean is the colour."""
    color = np.full((256 * 64, 1), 100.3 / 255)
    dithered = evaluated(gl, FILE, "vec4(dithered(x.xxx), 1.0)", color, LINEAR=0)[:, 0].astype(
        np.float64
    )
    assert np.abs(255 * dithered - 100.3).max() <= 0.5 + 1e-4
    codes = np.round(255 * dithered)
    assert set(codes) == {100.0, 101.0}
    assert codes.mean() == pytest.approx(100.3, abs=0.01)
    blocks = codes.reshape(64, 256).reshape(16, 4, 64, 4).mean(axis=(1, 3))
    assert np.abs(blocks - 100.3).max() < 0.2
    linear = evaluated(gl, FILE, "vec4(dithered(x.xxx), 1.0)", color[:4], LINEAR=1)[:, :3]
    np.testing.assert_array_equal(linear, color.astype("f4")[:4] + np.zeros(3, "f4"))
