"""The exposures of a frame: points of the lens, and times."""

import numpy as np
import pytest

from ripple_sim.capture.snapshot import Exposures, disc_points
from ripple_sim.scene.scene_file import CameraEntry


@pytest.mark.parametrize("count", [1, 2, 7, 32, 100])
def test_lens_points_fill_the_disc_evenly(count):
    points = disc_points(count)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(points, axis=1).max(initial=0) <= 1.15
    if count >= 32:
        # of a full disc: a quarter along each axis, nothing between them
        np.testing.assert_allclose(points.T @ points / count, np.eye(2) / 4, atol=0.02)


def test_exposures_of_a_camera():
    assert len(Exposures.of(CameraEntry())) == 1
    assert not Exposures.of(CameraEntry(shutter=180.0, aperture=0.1, exposures=1)).offsets.any()
    exposures = Exposures.of(CameraEntry(shutter=180.0, aperture=0.1, exposures=40))
    np.testing.assert_allclose(exposures.times, np.arange(40) / 80)
    # whatever part of the time is looked at, the eye has been all over the lens
    for begin in range(0, 40, 10):
        part = exposures.offsets[begin : begin + 10]
        assert np.linalg.norm(part.mean(axis=0)) < 0.015
        assert 0.025 < np.linalg.norm(part, axis=1).mean() < 0.042
