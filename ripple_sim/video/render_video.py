"""`render_video`: a scene rendered to a video. Simulation, rendering and encoding overlap."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from ripple_sim.coupling.physics_messages import adopt_warnings
from ripple_sim.encode import FrameWriter
from ripple_sim.errors import VideoError
from ripple_sim.overlay.comparison import compared_operators
from ripple_sim.scene.camera_override import with_exposure
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver.errors import PATH, checked, instance
from ripple_sim.solver.gl import GLContext, shared_context

from .film import Film
from .open_video import open_video
from .options import VideoOptions
from .prefetch import Prefetch
from .settings import EXPOSURE, check_options, frame_count, render_settings, settled
from .shot import Shot
from .summary import Summary, Times

# Shots that wait to be rendered. One would do if all frames took the same time.
_WAITING = 2

# The simulation's state is fingerprinted every so many frames, to be compared when a render is resumed.
_CHECKED = 16

Progress = Callable[[int, int], None]


@checked(
    VideoError,
    scene=instance(Scene, ", from load_scene or drop_scene"),
    output=PATH,
    options=instance(VideoOptions, ", for instance VideoOptions(fps=30)"),
)
def render_video(
    scene: Scene,
    output: str | Path,
    options: VideoOptions = VideoOptions(),  # noqa: B008 - frozen
    *,
    progress: Progress | None = None,
    on_step: Callable[[Simulation], None] | None = None,
    on_frame: Callable[[Simulation], None] | None = None,
) -> Summary:
    """Simulate a scene and write its video.

    The same scene and options give the same video on the same machine, bit for bit. Until it is complete, finished
    frames are in a folder beside it, `output` with `.part` appended, and stay there if the render is interrupted.
    Resumed, the simulation runs again up to there and is checked to be the same; the frames are not rendered again.

    Parameters
    ----------
    scene : Scene
    output : path
        .mp4, .webm, .gif, .webp, or a folder for frames. It appears once it is complete.
    options : VideoOptions
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.
    on_step : callable, optional
        As for `Simulation`. It is called in a thread of its own, unless waves are computed by a software driver.
    on_frame : callable, optional
        Called with the simulation at the time of each frame, to record what it wants to; in the same thread.

    Raises
    ------
    RippleError
        Before anything is simulated if the output, an option, the scene or the render to resume is invalid; later if
        the physics becomes unstable or the video cannot be written.
    """
    times = Times.now()
    adopt_warnings()
    output = Path(output)
    options = settled(options, scene, output)
    check_options(options, output)
    scene = with_exposure(scene, **{name: getattr(options, name) for name in EXPOSURE})
    frames, gl = frame_count(options), shared_context()
    with open_video(output, options, render_settings(scene, options, frames, gl)) as writer:
        resumed_at = writer.frames
        film = Film(_simulations(scene, options, on_step), options, frames, on_frame)
        if options.passes:
            film.write_passes(output)
        ready = _write_frames(film, writer, frames, gl, progress)
    return Summary.of(film, writer, gl, resumed_at=resumed_at, started=times, ready=ready)


def _simulations(scene: Scene, options: VideoOptions, on_step: Callable[[Simulation], None] | None) -> list[Simulation]:
    """One simulation for each of the wave operators that are shown."""
    operators = compared_operators(options.compare)
    return [Simulation.of(scene, options, operator=operator, on_step=on_step) for operator in operators]


def _write_frames(film: Film, writer: FrameWriter, frames: int, gl: GLContext, progress: Progress | None) -> Times:
    """Render and write the frames that the video still lacks; return when the first could begin."""
    # a software driver renders on the processor, which is busy enough with one frame
    ahead = 0 if gl.software else 1
    shots = film.shots(alive=_WAITING + ahead + 2)
    # waves on a GPU and the renderer take turns with the OpenGL context; a software driver computes during its turn
    own_thread = film.simulations[0].backend == "cpu" or not gl.software
    with Prefetch(shots, _WAITING) if own_thread else contextlib.nullcontext(shots) as shots:
        film.prepare()
        ready = Times.now()
        for frame in film.render_all(_missing(shots, writer, progress, frames), ahead):
            writer.write(frame)
            if progress is not None:
                progress(writer.frames, frames)
    return ready


def _missing(shots: Iterable[Shot], writer: FrameWriter, progress: Progress | None, frames: int) -> Iterator[Shot]:
    """Check the simulation's states, and skip the frames that are there already."""
    resumed_at = writer.frames
    for shot in shots:
        if shot.exposure == 0 and shot.number % _CHECKED == 0:
            writer.check_state(shot.number, shot.digest())
        if shot.number >= resumed_at:
            yield shot
        elif progress is not None and shot.exposure == 0:
            progress(shot.number + 1, frames)
