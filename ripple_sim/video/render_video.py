"""`render_video`: a scene rendered to a video. Simulation, rendering and encoding overlap.

A `Film` is one simulation, or two side by side, rendered to frames with overlays, and with passes
beside them; a `Shot` is everything that one exposure of it shows. The simulation runs in a thread
of its own, a few frames ahead (`prefetched`); `Summary` is what it all took.
"""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.frame_source import FrameSource, Sighting, passes_of
from ripple_sim.capture.snapshot import Snapshot, snapshots
from ripple_sim.coupling.geoms import geom_name
from ripple_sim.coupling.hooks import adopt_warnings
from ripple_sim.encode import FrameWriter, open_writer
from ripple_sim.encode.part import Settings
from ripple_sim.encode.passes import PassFiles
from ripple_sim.errors import VideoError
from ripple_sim.overlay.notes import (
    TITLES,
    Notebook,
    Notes,
    color_table,
    compared_operators,
    grid_spacing,
)
from ripple_sim.overlay.panels import (
    Layout,
    Painter,
    PlacedMark,
    Projection,
    draw_marks,
    place_marks,
)
from ripple_sim.render import Surface
from ripple_sim.scene.overlays import parse_request
from ripple_sim.scene.scene import Scene, with_exposure
from ripple_sim.simulation import Simulation
from ripple_sim.solver.compile_clock import compile_times, work_clock
from ripple_sim.solver.errors import FUNCTION, PATH, checked, instance, user_line, work_for
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.sound import Microphone, gain

from .options import VideoOptions
from .settings import EXPOSURE, check_options, frame_count, render_settings, settled

_END: Any = object()
_WAITING = 2  # shots that wait to be rendered; one would do if all frames took the same time

# every so many frames the simulation's state is fingerprinted, to be compared when a render is
# resumed
_CHECKED = 16


@dataclasses.dataclass(frozen=True, eq=False)
class Shot:
    """An exposure of a film's frame: a snapshot of each run, and the overlays' content, which a whole frame shares."""

    snapshots: tuple[Snapshot, ...]
    notes: Notes

    @property
    def number(self) -> int:
        """Number of the frame, from 0."""
        return self.snapshots[0].number

    @property
    def exposure(self) -> int:
        """Number of the exposure within its frame, from 0."""
        return self.snapshots[0].exposure

    def digest(self) -> str:
        """Fingerprint of all runs, see `Snapshot.digest`."""
        return "".join(snapshot.digest() for snapshot in self.snapshots)


class Film:
    """Simulations of one scene that run in step, and their frames.

    Parameters
    ----------
    simulations : sequence of Simulation
        One, or two that are shown side by side and share the width.
    options : VideoOptions
        Settled. Linear frames are without overlays, and of one run.
    on_frame : sequence of callable
        Called with the first simulation at the time of each frame, in the thread that runs `shots`.
    """

    def __init__(
        self,
        simulations: Sequence[Simulation],
        options: VideoOptions,
        frames: int,
        on_frame: Sequence[Callable[[Simulation], None]] = (),
    ) -> None:
        self.simulations = simulations
        self._options = options
        self._frames = frames
        self._on_frame = on_frame
        self._request = parse_request(options.overlay or ())
        self._layout = Layout(*options.size)
        self._notebook = Notebook(self._request, simulations, frames, options.rate)
        self._sources: list[FrameSource] = []
        self._submitted: deque[Shot] = deque()
        self._marks: list[list[PlacedMark]] = []
        self._pass_files: PassFiles | None = None
        # the number of a frame whose passes are not written yet
        self._last_seen: tuple[int, Sighting] | None = None
        self.seconds = 0.0  # spent on frames so far
        operators = compared_operators(options.compare)
        ripples = simulations[0].ripples
        spacings = {grid_spacing(ripples[name].atlas.resolution) for name in ripples}
        self._painter = Painter(
            self._request,
            self._layout,
            duration=frames / options.rate,
            spacing=spacings.pop() if len(spacings) == 1 else 0,  # one that the targets share
            titles=[TITLES[operator] for operator in operators] if len(operators) > 1 else [],
        )

    def write_passes(self, output: Path, frames: int = 0) -> None:
        """Write the passes that the options ask for beside an output, which has so many frames already."""
        model = self.simulations[0].model
        geoms = self.simulations[0].ripples.geom_ids
        soft = {target + 1: name for name, target in geoms.items() if target >= model.ngeom}
        # what each number of the segmentation stands for
        segments = {
            0: "background",
            **{geom + 1: geom_name(model, geom) for geom in range(model.ngeom)},
            **soft,
        }
        self._pass_files = PassFiles(
            output, self._options.pass_format, segments, frames, self._options.overwrite
        )

    def see(self, shot: Shot) -> None:
        """Look at a shot whose frame is there already, for its passes, if they are not."""
        if (
            self._pass_files is not None
            and shot.exposure == 0
            and shot.number >= self._pass_files.complete
        ):
            self.prepare()
            start = work_clock()
            self._see((shot.number, self._sources[0].sighting(shot.snapshots[0])))
            self.seconds += work_clock() - start

    def prepare(self) -> None:
        """Make the renderers, which takes a while, before the first frame; the simulations may run meanwhile."""
        if self._sources:
            return
        count = len(self.simulations)
        options = self._options
        ends = [round(self._layout.width * k / count) for k in range(count + 1)]
        self._sources = [
            FrameSource(
                simulation,
                width=right - left,
                height=self._layout.height,
                supersample=options.supersample,
                transparent=options.transparent,
                linear=options.linear,
                annotate=self._annotated,
            )
            for simulation, left, right in zip(self.simulations, ends[:-1], ends[1:], strict=True)
        ]

    def shots(self, alive: int = 1) -> Iterator[Shot]:
        """Run the simulations; `alive` of the latest shots stay valid, see `snapshots`."""
        runs = [snapshots(simulation, self._frames, alive=alive) for simulation in self.simulations]
        for exposures in zip(*runs, strict=True):
            if exposures[0].exposure == 0:
                notes = self._notebook.follow()
                for look in self._on_frame:
                    look(self.simulations[0])
            yield Shot(exposures, notes)

    def render_all(self, shots: Iterable[Shot], ahead: int = 0) -> Iterator[NDArray]:
        """Render frames in their order, and wait for each shot when `ahead` later ones are submitted."""
        for shot in shots:
            self.submit(shot)
            if len(self._submitted) > ahead and (frame := self.fetch()) is not None:
                yield frame
        while self._submitted:
            if (frame := self.fetch()) is not None:
                yield frame
        self._see(None)

    def submit(self, shot: Shot) -> None:
        """Draw an exposure without waiting for it: `fetch` returns it, after those submitted before.

        The shot must stay as it is until then.
        """
        self.prepare()
        start = work_clock()
        for number, (source, snapshot) in enumerate(
            zip(self._sources, shot.snapshots, strict=True)
        ):
            if self._request.heatmap and shot.exposure == 0:
                geoms = self.simulations[number].ripples.geom_ids
                for name, heatmap in shot.notes.heatmaps[number].items():
                    source.renderer.set_heatmap(geoms[name], heatmap, shot.notes.heatmap_scale[0])
            source.submit(snapshot)
            if self._pass_files is not None and shot.exposure == 0:
                self._see((shot.number, source.sighting(snapshot)))
        self._submitted.append(shot)
        self.seconds += work_clock() - start

    def warn_of_unseen(self, whole: bool) -> None:
        """Warn of waves that no frame shows, neither by their height nor by colours; of none only in a whole scene."""
        if not self._request.heatmap:
            self._sources[0].shown.warn_of_low()
        if whole:
            self._sources[0].shown.warn_of_none()

    def _see(self, seen: tuple[int, Sighting] | None) -> None:
        """Write the passes of the last frame, whose pixels flow to what is seen now, if anything."""
        if self._pass_files is None:
            return
        # not before: a render that fails without a frame leaves all as it was
        if self._last_seen is None:
            self._pass_files.begin()
        else:
            number, sighting = self._last_seen
            passes = passes_of(
                sighting, None if seen is None else seen[1], tuple(self._options.passes)
            )
            self._pass_files.write(number, passes)
        self._last_seen = seen

    def fetch(self) -> NDArray | None:
        """Wait for the earliest exposure submitted, and return what `render` does."""
        start = work_clock()
        shot = self._submitted.popleft()
        if shot.exposure == 0:
            self._marks = [self._placed_marks(run, shot) for run in range(len(self._sources))]
        halves = [half for source in self._sources if (half := source.fetch()) is not None]
        frame = None
        if halves:  # the runs' images side by side, under the overlays
            for half, marks in zip(halves, self._marks, strict=True):
                draw_marks(half, marks, self._layout)
            frame = halves[0]
            if len(halves) > 1:
                frame = np.concatenate(halves, axis=1)
                middle = halves[0].shape[1]
                seam = max(1, round(self._layout.em / 16))
                frame[:, middle - seam : middle + seam] = 255
            self._painter.paint(frame, shot.notes)
        self.seconds += work_clock() - start
        return frame

    def _placed_marks(self, run: int, shot: Shot) -> list[PlacedMark]:
        """Contact marks of a run, in pixels of its image."""
        if not self._request.contacts:
            return []
        source = self._sources[run]
        snapshot = shot.snapshots[run]
        notes = shot.notes
        projection = Projection(source.camera(snapshot).pose(), source.width, source.height)
        hiding = self.simulations[run].model, snapshot.data
        return place_marks(notes.marks[run], notes.mark_scale[0], self._layout, projection, *hiding)

    def _annotated(self, surface: Surface) -> Surface:
        """A target's surface with the heatmap and the grid that the request asks for."""
        return dataclasses.replace(
            surface,
            heatmap_colors=color_table() if self._request.heatmap else None,
            grid=grid_spacing(surface.charts.page.resolution) if self._request.grid else 0,
        )


def open_video(
    output: Path, options: VideoOptions, settings: Settings | None = None
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


@contextlib.contextmanager
def prefetched(items: Iterable[Item], depth: int) -> Iterator[Iterator[Item]]:
    """Run an iterable in a thread, at most `depth` items ahead; iterate over what this yields instead.

    Items come in their order; the thread alone consumes them. An exception of the iterable is
    raised in place of its next item. Leaving the block stops the thread at its current item.
    """
    iterator = iter(items)
    pool = ThreadPoolExecutor(1, "simulation", initializer=work_for, initargs=(user_line(),))
    # one more than wait: it is held until there is room
    waiting = deque(pool.submit(next, iterator, _END) for _ in range(depth + 1))

    def take() -> Iterator[Item]:
        while (item := waiting.popleft().result()) is not _END:
            waiting.append(pool.submit(next, iterator, _END))
            yield item

    try:
        yield take()
    finally:
        pool.shutdown(cancel_futures=True)


@dataclasses.dataclass(frozen=True)
class Summary:
    """What a rendered video took.

    Of its `frames`, those before `resumed_at` were there already. `renderer` is the driver's
    GL_RENDERER, `backend` the wave solver's. Times in seconds; the stages overlap, so they add up
    to more than `wall_seconds`. What was spent on compiling kernels, at their first use on a
    machine, is told apart from the work of the stages.
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


Progress = Callable[[int, int], None]


@checked(
    VideoError,
    scene=instance(Scene, ", from load_scene or drop_scene"),
    output=PATH,
    options=instance(VideoOptions, ", for instance VideoOptions(fps=30)"),
    progress=FUNCTION,
    on_step=FUNCTION,
    on_frame=FUNCTION,
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

    The same scene and options give the same video on the same machine, bit for bit. Until it is
    complete, finished frames are in a folder beside it, `output` with `.part` appended, and stay
    there if the render is interrupted. Resumed, the simulation runs again up to there and is
    checked to be the same; the frames are not rendered again.

    Parameters
    ----------
    output : path
        .mp4, .webm, .gif, .webp, or a folder for frames. It appears once it is complete.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.
    on_step : callable, optional
        As for `Simulation`. It is called in a thread of its own, unless waves are computed by a
        software driver.
    on_frame : callable, optional
        Called with the simulation at the time of each frame, to record what it wants to; in the
        same thread.

    Raises
    ------
    RippleError
        Before anything is simulated if the output, an option, the scene or the render to resume is
        invalid; later if the physics becomes unstable or the video cannot be written.
    """
    start = time.perf_counter()
    work_start = work_clock()
    compiled = sum(compile_times().values())
    adopt_warnings()
    output = Path(output)
    options = settled(options, scene, output)
    check_options(options, output)
    scene = with_exposure(scene, **{name: getattr(options, name) for name in EXPOSURE})
    frames = frame_count(options)
    gl = shared_context()
    with open_video(output, options, render_settings(scene, options, frames, gl)) as writer:
        resumed_at = writer.frames
        operators = compared_operators(options.compare)
        simulations = [
            Simulation.of(scene, options, operator=operator, on_step=on_step)
            for operator in operators
        ]
        microphone = (
            Microphone(simulations[0].ripples, options.slow_motion) if options.sound else None
        )
        looks = [look for look in (on_frame, microphone and microphone.follow) if look]
        film = Film(simulations, options, frames, looks)
        if options.passes:
            film.write_passes(output, resumed_at)
        ready = _write_frames(film, writer, frames, gl, progress)
        if not resumed_at:  # the frames before were not looked at
            film.warn_of_unseen(whole=(options.duration or 0.0) >= scene.duration)
        if microphone is not None:
            pressure = microphone.pressure(frames / options.rate)
            writer.sound = pressure * gain(pressure)
    return Summary(
        output=writer.path,
        frames=writer.frames,
        resumed_at=resumed_at,
        renderer=gl.renderer,
        backend=simulations[0].backend,
        substeps_per_frame=sum(each.substeps_taken for each in simulations)
        / max(writer.frames - 1, 1),
        compile_seconds=sum(compile_times().values()) - compiled,
        setup_seconds=ready - work_start,
        physics_seconds=sum(each.physics_seconds for each in simulations),
        wave_seconds=sum(each.wave_seconds for each in simulations),
        render_seconds=film.seconds,
        encode_seconds=writer.encode_seconds,
        wall_seconds=time.perf_counter() - start,
    )


def _write_frames(
    film: Film, writer: FrameWriter, frames: int, gl: GLContext, progress: Progress | None
) -> float:
    """Render and write the frames that the video still lacks; return the `work_clock` when the first could begin."""
    # a software driver renders on the processor, which is busy enough with one frame
    ahead = 0 if gl.software else 1
    shots = film.shots(alive=_WAITING + ahead + 2)
    # waves on a GPU and the renderer take turns with the OpenGL context; a software driver computes
    # during its turn
    own_thread = film.simulations[0].backend == "cpu" or not gl.software
    with prefetched(shots, _WAITING) if own_thread else contextlib.nullcontext(shots) as shots:
        film.prepare()
        ready = work_clock()
        for frame in film.render_all(_missing(shots, film, writer, progress, frames), ahead):
            writer.write(frame)
            if progress is not None:
                progress(writer.frames, frames)
    return ready


def _missing(
    shots: Iterable[Shot], film: Film, writer: FrameWriter, progress: Progress | None, frames: int
) -> Iterator[Shot]:
    """Check the simulation's states, and skip the frames that are there already."""
    resumed_at = writer.frames
    for shot in shots:
        if shot.exposure == 0 and shot.number % _CHECKED == 0:
            writer.check_state(shot.number, shot.digest())
        if shot.number >= resumed_at:
            yield shot
            continue
        film.see(shot)
        if progress is not None and shot.exposure == 0:
            progress(shot.number + 1, frames)
