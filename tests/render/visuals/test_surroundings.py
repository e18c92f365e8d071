"""Surroundings of a scene: the horizon of a skybox, into which the floor fades."""

import numpy as np
import pytest
from drawn import frame_of

from ripple_sim.render.camera import FixedCamera
from ripple_sim.render.tone_mapping import srgb_to_linear
from ripple_sim.render.visuals.surroundings import horizon_of

# sRGB of the sides of a skybox: +x, -x, up, down, south (-y) and north (+y) in the world, since a
# skybox has +y up
SIDES = np.array(
    [[200, 40, 40], [40, 200, 40], [0, 0, 0], [255, 255, 255], [40, 40, 200], [200, 200, 40]],
    np.uint8,
)


def sky(size: int = 64) -> np.ndarray:
    return np.concatenate([np.broadcast_to(side, (size, size, 3)) for side in SIDES]).copy()


def test_a_horizon_has_the_colours_of_its_sides_without_stars():
    pixels = sky()
    random = np.random.default_rng(3)
    pixels[random.random(pixels.shape[:2]) < 0.05] = 255
    colors = horizon_of(pixels)
    east, north, west, south = (colors[i * len(colors) // 4] for i in range(4))
    for seen, side in ((east, 0), (north, 5), (west, 1), (south, 4)):
        np.testing.assert_allclose(seen, srgb_to_linear(SIDES[side] / 255.0), atol=1e-9)


def test_a_smooth_horizon_stays_as_it_is():
    gradient = np.linspace(60, 200, 64).astype(np.uint8)[:, None, None]
    assert horizon_of(np.tile(np.broadcast_to(gradient, (64, 64, 3)), (6, 1, 1))) is None
    assert horizon_of(np.broadcast_to(gradient, (64, 64, 3))) is None


@pytest.mark.parametrize("azimuth", [0, 90, 180, 270])
def test_stars_are_not_drawn_out_over_a_floor_that_fades_into_their_sky(gl, azimuth):
    """The far floor has the colour of the sky over it, in every direction."""
    stars = (
        '<texture type="skybox" builtin="gradient" rgb1=".2 .4 .6" rgb2=".2 .4 .6" '
        'width="128" '
        'height="128" {}/>'
    )
    turn = np.radians(azimuth)
    forward = np.array([np.cos(turn), np.sin(turn), 0.0])
    rotation = np.stack([[np.sin(turn), -np.cos(turn), 0.0], [0.0, 0.0, 1.0], -forward], axis=1)
    camera = FixedCamera(np.array([0.0, 0.0, 0.5]), rotation, 2.0)
    floor = '<light/><geom type="plane" size="0 0 1" rgba=".1 .1 .1 1"/><geom size=".1"/>'
    frames = []
    for mark in ("", 'mark="random" random=".05" markrgb="1 1 1"'):
        asset = stars.format(mark)
        frames.append(
            frame_of(gl, floor, asset=asset, camera=camera, size=(96, 64), lighting="model").astype(
                int
            )
        )
    plain, starry = (frame[33:] for frame in frames)
    assert np.abs(frames[1] - frames[0])[:32].max() > 50
    assert np.abs(starry - plain).max() <= 3
