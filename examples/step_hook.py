"""A Python function that is called before every physics step: here it stirs a sphere with an invisible finger.

Makes out/step_hook.mp4. The function gets the running `Simulation`: MuJoCo's model and data, to steer actuators or move
mocap bodies, and the ripples, to press on surfaces.
"""

import numpy as np

from ripple_sim.scene.load_scene import load_scene
from ripple_sim.simulation import Simulation
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import render_video

FORCE = 12.0  # N
TURNS = 0.4  # 1/s
MIDDLE = (0.0, 0.0, 0.5)  # of the sphere [m]


def stir(simulation: Simulation) -> None:
    """Press on a point that goes round the top."""
    time, timestep = simulation.data.time, simulation.model.opt.timestep
    angle = 2 * np.pi * TURNS * time
    point = MIDDLE + 0.5 * np.array([0.6 * np.cos(angle), 0.6 * np.sin(angle), 0.8])  # in the frame of the body
    simulation.ripples.poke("sphere", point, FORCE * timestep, radius=0.04)


if __name__ == "__main__":
    summary = render_video(load_scene("sphere"), "out/step_hook.mp4", VideoOptions(duration=3.0), on_step=stir)
    print(f"{summary.frames} frames in {summary.output}")
