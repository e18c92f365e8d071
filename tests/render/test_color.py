"""The sRGB transfer curve."""

import numpy as np

from ripple_sim.render.camera import linear_to_srgb, srgb_to_linear


def test_the_curves_are_inverse_to_one_another() -> None:
    values = np.linspace(0.0, 1.0, 4001)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(values)), values, atol=1e-7)
    np.testing.assert_allclose(srgb_to_linear(linear_to_srgb(values)), values, atol=1e-7)
    assert (np.diff(linear_to_srgb(values)) > 0).all()


def test_known_values() -> None:
    np.testing.assert_allclose(srgb_to_linear([0.0, 0.04045, 0.5, 1.0]), [0.0, 0.0031308, 0.21404, 1.0], atol=1e-5)
    np.testing.assert_allclose(linear_to_srgb([0.0, 0.18, 0.5, 1.0]), [0.0, 0.46136, 0.73536, 1.0], atol=1e-5)
