"""Geoms within reach of a risen surface are pushed, and others are not."""

import numpy as np
from ring_under_ball import run


def test_ripple_reaches_a_ball_above_it_only_as_high_as_the_wave() -> None:
    """MuJoCo sees no contact; the ball is met by the displaced surface, and what it gains the surface loses."""
    heights, total, _ = run(two_way=True, speed=4.0, mass=0.05, gap=0.004, gravity=0.0)
    assert heights[-1] > 0.05
    _, ball, surface, _ = total.T
    np.testing.assert_allclose((ball + surface)[1:], surface[0], rtol=1e-4)
    missed, _, _ = run(two_way=True, speed=4.0, mass=0.05, gap=0.5, gravity=0.0)
    np.testing.assert_array_equal(missed, missed[0])
