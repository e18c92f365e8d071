"""Transparent objects, over what is behind them."""

import numpy as np
from drawn import FLOOR, FRONT, ball_surface, frame_of

from ripple_sim.render import Camera


def test_a_transparent_geom_shows_what_is_behind_it(gl):
    wall = '<geom type="box" size="3 .1 3" pos="0 2 0" rgba="0 0 1 1"/>'
    glass = '<geom type="box" size=".5 .02 .5" pos="0 0 .5" rgba="1 0 0 {}"/>'
    middle = np.s_[55:65, 75:85]
    red, mixed, blue = (
        frame_of(gl, wall + pane, camera=FRONT)[middle].mean(axis=(0, 1))
        for pane in (glass.format(1.0), glass.format(0.5), "")
    )
    np.testing.assert_allclose(mixed, (red + blue) / 2, atol=12)


def test_a_transparent_plane_is_drawn_too(gl):
    pane = '<geom type="plane" size=".5 .5 .1" pos="0 0 .5" rgba="1 0 0 .5"/>'
    assert (frame_of(gl, FLOOR + pane) - frame_of(gl, FLOOR))[60, 80, 2] < -40


def test_water_shows_what_is_behind_it_and_clay_does_not(gl):
    """A wall behind the ball tints the middle of the frame through a clear body alone."""

    def middle(look: str, rgba: str) -> np.ndarray:
        body = f'<geom name="t" type="sphere" size="1"/><geom type="box" size="4 .1 4" pos="0 3 0" rgba="{rgba}"/>'
        camera = Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0, 40.0)
        frame = frame_of(gl, body, camera=camera, targets={"t": ball_surface(look, 1.0)}, size=(240, 180))
        return frame[80:100, 110:130].mean(axis=(0, 1))

    for look, seen in (("water", True), ("clay", False)):
        change = middle(look, "0 0 1 1") - middle(look, "1 0 0 1")
        assert bool(change[2] > 30) is seen, (look, change)
