"""States at times between physics steps."""

import numpy as np
import pytest
from exposed_scene import FPS, SPEED, THROW

from ripple_sim.capture.snapshot import ShutterTimes
from ripple_sim.simulation import Simulation


def test_states_within_a_step_are_interpolated_and_do_not_change_the_motion(make_scene):
    poke = '[[poke]]\ngeom = "egg"\ntime = 0.02\npoint = [0.0, 0.0, 0.05]\nimpulse = 1e-4\nradius = 0.02\n'
    scene = make_scene(script=THROW + poke)
    whole, parts = (Simulation(scene, fps=FPS, backend="cpu") for _ in range(2))
    steps, dt = whole.steps_per_frame, whole.model.opt.timestep
    times = np.array([0, 0.5, 1, 1.25, steps - 0.5, steps])
    shutter_times = ShutterTimes(parts, times / steps)
    for number in range(3):
        begin, start, heights = whole.data.time, whole.data.body("shot").xpos[1], [whole.ripples["egg"].height]
        for _ in range(steps):
            whole.step()
            heights.append(whole.ripples["egg"].height)
        whole.advance_frame()
        for time, (data, shown) in zip(times, shutter_times, strict=True):
            assert data.time == pytest.approx(begin + time * dt, abs=1e-12)
            if number:  # in frame 0 it stands still until the first step
                assert data.body("shot").xpos[1] == pytest.approx(start - SPEED * time * dt, abs=1e-9)
            before, after = heights[int(np.floor(time))], heights[int(np.ceil(time))]
            np.testing.assert_allclose(shown["egg"], before + (time % 1) * (after - before), rtol=1e-5, atol=1e-9)
        parts.advance_frame()
        np.testing.assert_array_equal(parts.data.qpos, whole.data.qpos)
        np.testing.assert_array_equal(parts.ripples["egg"].height, whole.ripples["egg"].height)
    assert whole.ripples["egg"].height.any()
