"""Ambient occlusion of the floor: geoms occlude the sky, sites do not."""

import numpy as np
from drawn import FLOOR, FRONT, frame_of


def test_sites_hide_no_sky(gl):
    """Under a wide site the floor stays as light as without it where no lamp shines."""
    roof = '<site type="box" size=".5 .5 .02" pos="0 0 .4" rgba="1 0 0 1"/>'
    light = {"visual": '<headlight ambient=".5 .5 .5" diffuse="0 0 0"/>', "lighting": "model", "camera": FRONT}
    frames = [frame_of(gl, FLOOR + body, **light) for body in (roof, roof.replace("site", "geom"), "")]
    under = np.s_[78:82, 75:85]
    site, geom, none = (frame[under].mean() for frame in frames)
    assert abs(site - none) < 1
    assert geom < none - 10
