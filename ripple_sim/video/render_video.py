"""`render_video`: a scene rendered to a video. Simulation, rendering and encoding overlap.

The simulation runs in a thread of its own, a few frames ahead (`Prefetch`); `Summary` is what it all took.
"""

from __future__ import annotations

import contextlib
import dataclasses
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

from ripple_sim.coupling.stepping import adopt_warnings
from ripple_sim.encode import FrameWriter, open_writer
from ripple_sim.errors import VideoError
from ripple_sim.overlay.notes import compared_operators
from ripple_sim.scene.scene import Scene, with_exposure
from ripple_sim.simulation import Simulation
from ripple_sim.solver.errors import PATH, checked, instance
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.solver.kernel import compile_times, work_clock

from .film import Film, Shot
from .options import VideoOptions
from .settings import EXPOSURE, check_options, frame_count, render_settings, settled


def open_video(
    output: Path, options: VideoOptions, settings: Mapping[str, str | int | float] | None = None
) -> FrameWriter:
    """Writer of a video with settled options; see `open_writer`."""
    return open_writer(
        output,
        width=options.size[0],
        height=options.size[1],
        fps=options.fps or 0,
        transparent=options.transparent,
        frame_format=options.frame_format,
        settings=settings,
        resume=options.resume,
        overwrite=options.overwrite,
    )


Item = TypeVar("Item")

_END = object()


class Prefetch(Generic[Item]):
    """Runs an iterable in a thread, at most `depth` items ahead; iterate over this instead, inside a `with`.

    Items come in their order. An exception of the iterable is raised in place of its next item. Leaving the block stops
    the thread at its current item.

    Parameters
    ----------
    items : iterable
        Consumed by the thread alone.
    depth : int
        How many finished items may wait.
    """

    def __init__(self, items: Iterable[Item], depth: int) -> None:
        self._items = items
        self._queue: queue.Queue[tuple[object, BaseException | None]] = queue.Queue(depth)
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)

    def __enter__(self) -> Iterator[Item]:
        self._thread.start()
        return self._take()

    def __exit__(self, *error: object) -> None:
        self._stopped = True
        while self._thread.is_alive():
            with contextlib.suppress(queue.Empty):  # makes room for the thread's current item
                self._queue.get(timeout=0.05)

    def _run(self) -> None:
        error: BaseException | None = None
        try:
            for item in self._items:
                if self._stopped:
                    return
                self._queue.put((item, None))
        except BaseException as failure:  # of any kind: it is raised in the consumer's thread
            error = failure
        self._queue.put((_END, error))

    def _take(self) -> Iterator[Item]:
        while True:
            item, error = self._queue.get()
            if error is not None:
                raise error
            if item is _END:
                return
            yield item  # type: ignore[misc]


class Times(NamedTuple):
    """A moment [s]: on the wall's clock, on this thread's `work_clock`, and the time of compilation so far."""

    wall: float
    work: float
    compiled: float

    @classmethod
    def now(cls) -> Times:
        """Take the time."""
        return cls(time.perf_counter(), work_clock(), sum(compile_times().values()))


@dataclasses.dataclass(frozen=True)
class Summary:
    """What a rendered video took.

    Of its `frames`, those before `resumed_at` were there already. `renderer` is the driver's GL_RENDERER, `backend` the
    wave solver's. Times in seconds; the stages overlap, so they add up to more than `wall_seconds`. What was spent on
    compiling kernels, at their first use on a machine, is told apart from the work of the stages.
    """

    output: Path
    frames: int
    resumed_at: int
    renderer: str
    backend: str
    substeps_per_frame: float
    compile_seconds: float
    setup_seconds: float
    physics_seconds: float
    wave_seconds: float
    render_seconds: float
    encode_seconds: float
    wall_seconds: float

    @classmethod
    def of(
        cls, film: Film, writer: FrameWriter, gl: GLContext, *, resumed_at: int, started: Times, ready: Times
    ) -> Summary:
        """Summary of a film that has been written; it was started, and its first frame could begin, at these times."""
        simulations, ended = film.simulations, Times.now()
        return cls(
            output=writer.path,
            frames=writer.frames,
            resumed_at=resumed_at,
            renderer=gl.renderer,
            backend=simulations[0].backend,
            substeps_per_frame=sum(each.substeps_taken for each in simulations) / max(writer.frames - 1, 1),
            compile_seconds=ended.compiled - started.compiled,
            setup_seconds=ready.work - started.work,
            physics_seconds=sum(each.physics_seconds for each in simulations),
            wave_seconds=sum(each.wave_seconds for each in simulations),
            render_seconds=film.seconds,
            encode_seconds=writer.encode_seconds,
            wall_seconds=ended.wall - started.wall,
        )


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
