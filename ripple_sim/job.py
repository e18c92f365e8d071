"""A scene rendered to a video: simulation, drawing and encoding, all three at the same time."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

import mujoco

from ripple_sim.solver.gl import shared_context

from .errors import SceneError
from .frames import FrameSource, run
from .pipeline import Ahead
from .scene.scene import MAX_DURATION, Scene
from .simulation import Simulation
from .video import check_output, open_writer

# Snapshots that wait to be drawn. One would do if all frames took the same time.
_WAITING = 2


@dataclasses.dataclass(frozen=True)
class Summary:
    """What a rendered video took.

    `renderer` is the driver's GL_RENDERER, `backend` the wave solver's; times in seconds.
    """

    output: Path
    frames: int
    renderer: str
    backend: str
    substeps_per_frame: float
    setup_seconds: float
    physics_seconds: float
    wave_seconds: float
    render_seconds: float
    encode_seconds: float
    wall_seconds: float


def render_video(
    scene: Scene,
    output: str | Path,
    *,
    size: tuple[int, int] = (1280, 720),
    fps: int = 60,
    duration: float | None = None,
    resolution: int | None = None,
    backend: str = "auto",
    progress: Callable[[int, int], None] | None = None,
    on_step: Callable[[Simulation], None] | None = None,
) -> Summary:
    """Simulate a scene and write its video.

    Parameters
    ----------
    scene : Scene
    output : path
        .mp4, .webm, .gif, or a folder for PNG frames. It appears when it is whole.
    size : (width, height)
        [pixels].
    fps : int
        Frames a second.
    duration : float, optional
        [s], instead of the scene's.
    resolution, backend, on_step
        As for `Simulation`.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Raises
    ------
    RippleError
        Before anything is simulated where the output, size, rate or scene is invalid; later if the physics becomes
        unstable or the video cannot be written on.
    """
    start = time.perf_counter()
    # MuJoCo would write its warnings to a file in the current folder; `Simulation` reports those that matter
    mujoco.set_mju_user_warning(lambda message: None)
    output, (width, height) = Path(output), size
    check_output(output, width, height, fps)
    length = scene.duration if duration is None else duration
    if not 0 < length < MAX_DURATION:
        raise SceneError(f"duration is {length!r} s; valid is a positive number, less than {MAX_DURATION}")
    count = max(1, round(length * fps))
    simulation = Simulation(scene, fps=fps, resolution=resolution, backend=backend, on_step=on_step)
    gl = shared_context()
    frames = FrameSource(simulation, width=width, height=height, gl=gl)
    ready = time.perf_counter()
    render_seconds = 0.0
    states = run(simulation, count, alive=_WAITING + 2)
    # waves on the GPU share the renderer's OpenGL context, which belongs to one thread at a time
    ahead = Ahead(states, _WAITING) if simulation.backend == "cpu" else contextlib.nullcontext(states)
    with open_writer(output, width=width, height=height, fps=fps) as writer, ahead as states:
        for state in states:
            if state is not None:
                before = time.perf_counter()
                frame = frames.draw(state)
                render_seconds += time.perf_counter() - before
                writer.write(frame)
            if progress is not None:
                progress(writer.frames, count)
    return Summary(
        output=output,
        frames=count,
        renderer=gl.renderer,
        backend=simulation.backend,
        substeps_per_frame=simulation.substeps_taken / max(count - 1, 1),
        setup_seconds=ready - start,
        physics_seconds=simulation.physics_seconds,
        wave_seconds=simulation.wave_seconds,
        render_seconds=render_seconds,
        encode_seconds=writer.encode_seconds,
        wall_seconds=time.perf_counter() - start,
    )
