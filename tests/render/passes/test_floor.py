"""The floor: its texture, its edges, and what is left of it under alpha."""

import numpy as np
from drawn import BALL, FLOOR, FRONT, SIZE, SUN, frame_of
from scipy.ndimage import binary_erosion


def test_floor_texture_repeats_as_in_mujoco(gl):
    """A repetition of a 2 x 2 checker is 2 m wide and begins at -1 m: squares of 1 m, a corner at the origin."""
    asset = (
        '<texture name="c" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="64" height="64"/>'
        '<material name="c" texture="c" texuniform="true"/>'
    )
    frame = frame_of(gl, '<geom type="plane" size="0 0 .1" material="c"/>', asset=asset)
    pixels = int(0.5 * SIZE[1] / (2 * 4.0 * np.tan(np.radians(20))))  # half a square
    y, x = SIZE[1] // 2, SIZE[0] // 2
    quarters = np.array([[frame[y + b * pixels, x + a * pixels].mean() for a in (-1, 1)] for b in (-1, 1)])
    assert abs(quarters[0, 0] - quarters[1, 1]) < 15
    assert abs(quarters[0, 1] - quarters[1, 0]) < 15
    assert abs(quarters[0, 0] - quarters[0, 1]) > 100


def test_the_edges_of_a_finite_floor_are_smooth(gl):
    """A white square in front of black: along its slanted edges lie pixels of all shades."""
    floor = '<geom type="plane" size=".5 .5 .1" euler="0 0 20" rgba="1 1 1 1"/>'
    sky = '<texture type="skybox" builtin="flat" rgb1="0 0 0" rgb2="0 0 0" width="16" height="96"/>'
    frame = frame_of(gl, floor + SUN.format(0.0, "false"), asset=sky)[..., 0]
    white = frame[60, 80]
    edge = (frame > 0.2 * white) & (frame < 0.8 * white)
    assert 40 < edge.sum() < 200
    shares = np.histogram(frame[edge] / white, bins=3, range=(0.2, 0.8))[0]
    assert shares.min() > 8


def test_alpha_leaves_the_geoms_and_their_shadows(gl):
    whole = frame_of(gl, FLOOR + BALL + SUN.format(0.5, "true"), camera=FRONT)
    frame = frame_of(gl, FLOOR + BALL + SUN.format(0.5, "true"), camera=FRONT, alpha=True)
    assert frame.shape == (SIZE[1], SIZE[0], 4)
    assert frame[0, 0, 3] == 0
    ball = binary_erosion(np.abs(whole[..., 0] - whole[..., 2]) > 60, iterations=2)
    assert ball.sum() > 200
    assert (frame[ball][:, 3] == 255).all()
    np.testing.assert_allclose(frame[ball][:, :3], whole[ball], atol=1)
    shadow = (np.abs(frame[..., :3]).max(axis=2) == 0) & (frame[..., 3] > 100)
    assert shadow.sum() > 50
