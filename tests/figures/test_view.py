"""Looks at a surface."""

import numpy as np
import pytest

from ripple_sim.figures.atlas_view import View
from ripple_sim.scene.drop import usual_up


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_up_axis_points_up(up):
    axes = View(azimuth=20, elevation=30, up=up).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    right, upwards, eye = axes[:, "xyz".index(up)]
    assert (right, upwards > 0.8, eye > 0.4) == (pytest.approx(0), True, True)
    assert usual_up("part.STL") == "z"
    assert usual_up("animal.obj") == "y"
