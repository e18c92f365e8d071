"""`render_video`: a scene rendered to a video. Simulation, rendering and encoding overlap.

A `Film` is one simulation, or two side by side, rendered to frames with overlays; passes may be
written beside the frames. A `Shot` is everything that one exposure of a film shows. The simulation
runs in a thread of its own, a few frames ahead (`prefetched`). `Summary` lists the times it took.
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

from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.sighting import Sighting, passes_of
from ripple_sim.capture.snapshot import Snapshot, snapshots
from ripple_sim.coupling.geoms import geom_name
from ripple_sim.coupling.hooks import adopt_warnings
from ripple_sim.coupling.ids import geom_id, is_geom
from ripple_sim.encode import FrameWriter, open_writer
from ripple_sim.encode.part import Settings
from ripple_sim.encode.passes import PassFiles
from ripple_sim.errors import VideoError
from ripple_sim.overlay.color_map import color_table
from ripple_sim.overlay.layout import Layout
from ripple_sim.overlay.notes import Notebook, Notes, grid_spacing
from ripple_sim.overlay.operators import TITLES, compared_operators
from ripple_sim.overlay.painter import Painter
from ripple_sim.overlay.placed_marks import PlacedMark, Projection, draw_marks, place_marks
from ripple_sim.render import Surface
from ripple_sim.scene.overlays import parse_request
from ripple_sim.scene.scene import Scene, through_camera, with_exposure
from ripple_sim.simulation import Simulation
from ripple_sim.solver.compile_clock import compile_times, work_clock
from ripple_sim.solver.errors import FUNCTION, PATH, checked, instance, user_line, work_for
from ripple_sim.solver.gl import GLContext
from ripple_sim.sound import Microphone, gain, scale_note

from .options import VideoOptions
from .settings import (
    EXPOSURE,
    check_options,
    chosen_context,
    frame_count,
    render_settings,
    settled,
)

# An item of an iterable that runs ahead.
Item = TypeVar("Item")

# Called with the number of frames done and of all frames.
Progress = Callable[[int, int], None]

# Marks the end of an iterator.
_END: Any = object()

# Number of shots that wait to be rendered; one would do if all frames took the same time.
_WAITING_SHOTS = 2

# Frames from one fingerprint of the simulation's state to the next. A render that is resumed
# compares them.
_FINGERPRINT_INTERVAL = 16


@dataclasses.dataclass(frozen=True, eq=False)
class Shot:
    """One exposure of a frame of a film.

    Attributes
    ----------
    snapshots : tuple of Snapshot
        One for each run.
    notes : Notes
        Content of the overlays, the same for all exposures of a frame.
    """

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
        """Fingerprint of the state of all runs, see `Snapshot.digest`."""
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
        self.seconds = 0.0  # spent on frames so far
        self._options = options
        self._frames = frames
        self._on_frame = on_frame
        self._request = parse_request(options.overlay or ())
        self._layout = Layout(*options.size)
        self._notebook = Notebook(self._request, simulations, frames, options.rate)
        self._painter = self._make_painter()
        self._sources: list[FrameSource] = []
        self._submitted: deque[Shot] = deque()
        self._marks: list[list[PlacedMark]] = []
        self._pass_files: PassFiles | None = None
        # number and sighting of the latest frame: its passes are written with the next frame's
        # sighting, to which its pixels flow
        self._latest_sighting: tuple[int, Sighting] | None = None

    def _make_painter(self) -> Painter:
        """The painter of the overlays."""
        operators = compared_operators(self._options.compare)
        ripples = self.simulations[0].ripples
        spacings = {grid_spacing(ripples[name].atlas.resolution) for name in ripples}
        return Painter(
            self._request,
            self._layout,
            duration=self._frames / self._options.rate,
            spacing=spacings.pop() if len(spacings) == 1 else 0,  # 0: the targets differ
            titles=[TITLES[operator] for operator in operators] if len(operators) > 1 else [],
        )

    def write_passes(self, output: Path, frames: int = 0) -> None:
        """Have the passes that the options ask for written beside an output.

        `frames` is the number of frames that the output has already.
        """
        model = self.simulations[0].model
        # names of the numbers of the segmentation: those of geoms, then those of soft targets
        segments = {0: "background"}
        for geom in map(geom_id, range(model.ngeom)):
            segments[geom + 1] = geom_name(model, geom)
        for name, target in self.simulations[0].ripples.geom_ids.items():
            if not is_geom(target, model):
                segments[target + 1] = name
        self._pass_files = PassFiles(
            output, self._options.pass_format, segments, frames, self._options.overwrite
        )

    def see(self, shot: Shot) -> None:
        """Write the passes of a shot whose frame exists already, if the passes do not exist."""
        if self._pass_files is None or shot.exposure > 0:
            return
        if shot.number < self._pass_files.complete:
            return
        self.prepare()
        start = work_clock()
        self._take_sighting((shot.number, self._sources[0].sighting(shot.snapshots[0])))
        self.seconds += work_clock() - start

    def prepare(self) -> None:
        """Make the renderers, which takes a while; the simulations may run meanwhile."""
        if self._sources:
            return
        count = len(self.simulations)
        options = self._options
        for k, simulation in enumerate(self.simulations):
            left = round(self._layout.width * k / count)
            right = round(self._layout.width * (k + 1) / count)
            source = FrameSource(
                simulation,
                width=right - left,
                height=self._layout.height,
                supersample=options.supersample,
                transparent=options.transparent,
                linear=options.linear,
                annotate=self._annotated,
            )
            self._sources.append(source)

    def shots(self, alive: int = 1) -> Iterator[Shot]:
        """Run the simulations; `alive` of the latest shots stay valid, see `snapshots`."""
        runs = [snapshots(simulation, self._frames, alive=alive) for simulation in self.simulations]
        for exposures in zip(*runs, strict=True):
            if exposures[0].exposure == 0:
                notes = self._notebook.follow()
                for call in self._on_frame:
                    call(self.simulations[0])
            yield Shot(exposures, notes)

    def render_all(self, shots: Iterable[Shot], ahead: int = 0) -> Iterator[NDArray]:
        """Render frames in their order; `ahead` shots are submitted before a shot is fetched."""
        for shot in shots:
            self.submit(shot)
            if len(self._submitted) > ahead:
                frame = self.fetch()
                if frame is not None:
                    yield frame
        while self._submitted:
            frame = self.fetch()
            if frame is not None:
                yield frame
        self._take_sighting(None)

    def submit(self, shot: Shot) -> None:
        """Draw an exposure without waiting for it: `fetch` returns shots in their order.

        The shot must stay as it is until it is fetched.
        """
        self.prepare()
        start = work_clock()
        for run, source in enumerate(self._sources):
            snapshot = shot.snapshots[run]
            if self._request.heatmap and shot.exposure == 0:
                self._set_heatmaps(run, shot.notes)
            source.submit(snapshot)
            if self._pass_files is not None and shot.exposure == 0:
                self._take_sighting((shot.number, source.sighting(snapshot)))
        self._submitted.append(shot)
        self.seconds += work_clock() - start

    def warn_of_unseen(self, is_complete: bool) -> None:
        """Warn of waves that no frame shows, neither by their height nor by colours.

        After a complete scene also warn of targets without any wave. A video with sound, and
        targets whose scene asks for no warnings, may be for the ear.
        """
        if not (self._request.heatmap or self._options.sound):
            targets = self.simulations[0].scene.targets
            silent = [entry.geom for entry in targets if not (entry.warn or entry.limit)]
            self._sources[0].shown.warn_of_low(silent)
        if is_complete:
            self._sources[0].shown.warn_of_none()

    def _set_heatmaps(self, run: int, notes: Notes) -> None:
        """Give the renderer of a run the heatmaps of a frame."""
        geoms = self.simulations[run].ripples.geom_ids
        limit, _ = notes.heatmap_scale
        for name, heatmap in notes.heatmaps[run].items():
            self._sources[run].renderer.set_heatmap(geoms[name], heatmap, limit)

    def _take_sighting(self, numbered_sighting: tuple[int, Sighting] | None) -> None:
        """Take the number and the sighting of a frame, and write the passes of the frame before.

        None comes after the last frame.
        """
        if self._pass_files is None:
            return
        if self._latest_sighting is None:
            # not earlier: a render that fails before its first frame leaves all files as they were
            self._pass_files.begin()
        else:
            number, sighting = self._latest_sighting
            later = None if numbered_sighting is None else numbered_sighting[1]
            passes = passes_of(sighting, later, tuple(self._options.passes))
            self._pass_files.write(number, passes)
        self._latest_sighting = numbered_sighting

    def fetch(self) -> NDArray | None:
        """Wait for the earliest shot; return a frame after its last exposure, else None."""
        start = work_clock()
        shot = self._submitted.popleft()
        if shot.exposure == 0:
            self._marks = [self._placed_marks(run, shot) for run in range(len(self._sources))]
        images = [source.fetch() for source in self._sources]
        complete = [image for image in images if image is not None]
        frame = self._composed(complete, shot.notes) if complete else None
        self.seconds += work_clock() - start
        return frame

    def _composed(self, images: list[NDArray], notes: Notes) -> NDArray:
        """The images of the runs side by side, under the overlays; the images are drawn over."""
        for image, marks in zip(images, self._marks, strict=True):
            draw_marks(image, marks, self._layout)
        frame = images[0]
        if len(images) > 1:
            frame = np.concatenate(images, axis=1)
            middle = images[0].shape[1]
            half_seam = max(1, round(self._layout.em / 16))
            frame[:, middle - half_seam : middle + half_seam] = 255
        self._painter.paint(frame, notes)
        return frame

    def _placed_marks(self, run: int, shot: Shot) -> list[PlacedMark]:
        """Contact marks of a run, in pixels of its image."""
        if not self._request.contacts:
            return []
        source = self._sources[run]
        snapshot = shot.snapshots[run]
        marks = shot.notes.marks[run]
        scale, _ = shot.notes.mark_scale
        projection = Projection(source.camera(snapshot).pose(), source.width, source.height)
        model = self.simulations[run].model
        return place_marks(marks, scale, self._layout, projection, model, snapshot.data)

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


@contextlib.contextmanager
def prefetched(items: Iterable[Item], depth: int) -> Iterator[Iterator[Item]]:
    """Run an iterable in a thread, at most `depth` items ahead.

    The context is an iterator over the same items, in their order; only the thread runs the
    iterable. An exception of the iterable is raised instead of its next item. Leaving the block
    stops the thread at its current item.
    """
    iterator = iter(items)
    pool = ThreadPoolExecutor(1, "simulation", initializer=work_for, initargs=(user_line(),))
    # one item more than `depth`: the thread holds it until there is room
    waiting = deque(pool.submit(next, iterator, _END) for _ in range(depth + 1))

    def take() -> Iterator[Item]:
        item = waiting.popleft().result()
        while item is not _END:
            waiting.append(pool.submit(next, iterator, _END))
            yield item
            item = waiting.popleft().result()

    try:
        yield take()
    finally:
        pool.shutdown(cancel_futures=True)


@dataclasses.dataclass(frozen=True)
class Summary:
    """Frames and times of a rendered video.

    The frames before `resumed_at` existed already. `renderer` is the driver's GL_RENDERER,
    `backend` the backend of the wave solver. The times of the stages [s] add up to more than
    `wall_seconds`, because the stages overlap. `compile_seconds`, for kernels that are used for the
    first time on a machine, is not part of the stages' times. If there is a sound, `sound` is the
    unit of its samples, and the frequency up to which it is right.
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
    sound: str = ""


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

    The same scene and options give the same video on the same machine, bit for bit. Until the video
    is complete, finished frames are in a folder beside it, `output` with `.part` appended; they
    stay there if the render is interrupted. A render that is resumed runs the simulation again up
    to the interruption and checks that it is the same; it does not render the frames again.

    Parameters
    ----------
    output : path
        .mp4, .webm, .gif, .webp, or a folder for frames. It appears when it is complete.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.
    on_step : callable, optional
        As for `Simulation`. It is called in the simulation's thread, unless waves are computed by a
        software driver.
    on_frame : callable, optional
        Called with the simulation at the time of each frame, for records of one's own, in the same
        thread.

    Raises
    ------
    RippleError
        Before anything is simulated if the output, an option, the scene or the render to resume is
        invalid; later if the physics becomes unstable or the video cannot be written.
    """
    start = time.perf_counter()
    work_start = work_clock()
    compiled_before = sum(compile_times().values())  # [s]
    adopt_warnings()
    output = Path(output)
    options = settled(options, scene, output)
    check_options(options, output)
    scene = through_camera(scene, options.camera)
    scene = with_exposure(scene, **{name: getattr(options, name) for name in EXPOSURE})
    frames = frame_count(options)
    gl = chosen_context(options)
    with open_video(output, options, render_settings(scene, options, frames, gl)) as writer:
        resumed_at = writer.frames
        operators = compared_operators(options.compare)
        simulations = [
            Simulation.of(scene, options, operator=operator, on_step=on_step)
            for operator in operators
        ]
        on_frames = [] if on_frame is None else [on_frame]
        microphone = None
        sound = ""
        if options.sound:
            microphone = Microphone(simulations[0].ripples, options.slow_motion)
            on_frames.append(microphone.follow)
        film = Film(simulations, options, frames, on_frames)
        if options.passes:
            film.write_passes(output, resumed_at)
        ready = _write_frames(film, writer, frames, gl, progress)
        if not resumed_at:  # the frames of an earlier render may have shown waves
            film.warn_of_unseen(is_complete=(options.duration or 0.0) >= scene.duration)
        if microphone is not None:
            pressure = microphone.pressure(frames / options.rate)
            writer.sound = pressure * gain(pressure)
            sound = scale_note(pressure, "Pa", microphone.bandwidth / options.slow_motion)
    substeps = sum(simulation.substeps_taken for simulation in simulations)
    return Summary(
        output=writer.path,
        frames=writer.frames,
        resumed_at=resumed_at,
        renderer=gl.renderer,
        backend=simulations[0].backend,
        substeps_per_frame=substeps / max(writer.frames - 1, 1),
        compile_seconds=sum(compile_times().values()) - compiled_before,
        setup_seconds=ready - work_start,
        physics_seconds=sum(simulation.physics_seconds for simulation in simulations),
        wave_seconds=sum(simulation.wave_seconds for simulation in simulations),
        render_seconds=film.seconds,
        encode_seconds=writer.encode_seconds,
        wall_seconds=time.perf_counter() - start,
        sound=sound,
    )


def _write_frames(
    film: Film, writer: FrameWriter, frames: int, gl: GLContext, progress: Progress | None
) -> float:
    """Render and write the frames that the video still lacks.

    Return the `work_clock` [s] when everything was ready for the first frame.
    """
    # a software driver renders on the processor, which is busy enough with one frame
    ahead = 0 if gl.software else 1
    shots = film.shots(alive=_WAITING_SHOTS + ahead + 2)
    # Waves on a GPU and the renderer take turns with the OpenGL context. A software driver computes
    # during its turn, so that a thread would gain nothing.
    own_thread = film.simulations[0].backend == "cpu" or not gl.software
    thread = prefetched(shots, _WAITING_SHOTS) if own_thread else contextlib.nullcontext(shots)
    with thread as shots:
        film.prepare()
        ready = work_clock()
        missing = _missing(shots, film, writer, progress, frames)
        for frame in film.render_all(missing, ahead):
            writer.write(frame)
            if progress is not None:
                progress(writer.frames, frames)
    return ready


def _missing(
    shots: Iterable[Shot], film: Film, writer: FrameWriter, progress: Progress | None, frames: int
) -> Iterator[Shot]:
    """Check the states of the simulation, and skip the frames that exist already."""
    resumed_at = writer.frames
    for shot in shots:
        if shot.exposure == 0 and shot.number % _FINGERPRINT_INTERVAL == 0:
            writer.check_state(shot.number, shot.digest())
        if shot.number >= resumed_at:
            yield shot
            continue
        film.see(shot)
        if progress is not None and shot.exposure == 0:
            progress(shot.number + 1, frames)
