"""A Python function that is called before every physics step stirs a sphere.

Makes out/step_hook.mp4. The function gets the running `Simulation`: MuJoCo's model and data, to
steer actuators or move mocap bodies, and the ripples, to press on surfaces.
"""

import numpy as np

from ripple_sim import Simulation, VideoOptions, load_scene, render_video

FORCE = 12.0  # N
TURNS = 0.4  # 1/s
MIDDLE = (0.0, 0.0, 0.5)  # of the sphere [m]


def stir(simulation: Simulation) -> None:
    """Press on a point that goes round the top."""
    time = simulation.data.time
    timestep = simulation.model.opt.timestep
    angle = 2 * np.pi * TURNS * time
    # in the frame of the body
    point = MIDDLE + 0.5 * np.array([0.6 * np.cos(angle), 0.6 * np.sin(angle), 0.8])
    simulation.ripples.poke("sphere", point, FORCE * timestep, radius=0.04)


def main(duration: float = 3.0) -> None:
    summary = render_video(
        load_scene("sphere"), "out/step_hook.mp4", VideoOptions(duration=duration), on_step=stir
    )
    print(f"{summary.frames} frames in {summary.output}")


if __name__ == "__main__":
    main()
