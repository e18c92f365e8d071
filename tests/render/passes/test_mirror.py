"""The reflection in the floor."""

from drawn import BALL, frame_of

from ripple_sim.render import Camera


def test_a_reflecting_floor_shows_the_ball_upside_down(gl):
    def frame(reflectance: float):
        asset = f'<material name="f" rgba=".4 .4 .4 1" reflectance="{reflectance}"/>'
        floor = '<geom type="plane" size="0 0 .1" material="f"/>'
        ball = BALL.replace(".8 .2 .2", "1 0 0")
        return frame_of(gl, floor + ball, asset=asset, camera=Camera((0, 0, 0), 4.0, 90.0, -20.0, 40.0))

    redder = [(f[..., 0] - f[..., 2])[70:110, 70:90].max() for f in (frame(0.0), frame(0.5))]
    assert redder[1] > redder[0] + 40
