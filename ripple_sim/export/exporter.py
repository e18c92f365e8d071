"""`Exporter` writes a loop of one's own to a file frame by frame; `export_scene` writes a scene."""

from __future__ import annotations

import contextlib
import dataclasses
import html
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, Self

import mujoco

from ripple_sim.coupling.geoms import ByGeom, by_name
from ripple_sim.coupling.hooks import adopt_warnings
from ripple_sim.coupling.own_model import check_targets, own_data, own_model, posed
from ripple_sim.coupling.ripples import Impulse, Ripples
from ripple_sim.encode.part import Settings
from ripple_sim.errors import EncodingError, ExportError
from ripple_sim.render.visuals.visual import find_look, paint_of
from ripple_sim.scene.camera_entry import CameraEntry, check_camera
from ripple_sim.scene.scene import Scene, check_duration, through_camera
from ripple_sim.simulation import Simulation
from ripple_sim.solver.errors import PATH, POSITIVE, checked, instance
from ripple_sim.video.settings import frame_count, origin

from .colors import colors_by_name
from .options import HEIGHT_COLORS, MOST_TRIANGLES, ExportOptions
from .place import Unfinished, check_export, check_mesh_format, check_options, check_written
from .source import Source

_PAGE_HEIGHT = 420  # of a page within a notebook [pixels]


class Exporter:
    """Writes a model and its rippling surfaces to a file, frame by frame.

    Use it as a context manager: the file appears, complete, when the block is left; after an
    exception there is none.

    Parameters
    ----------
    model : mujoco.MjModel
        Or dm_control's wrapper of one; likewise the data of each frame.
    ripples : Ripples
        Whose targets are written with their ripples.
    output : path
        Its ending decides the format: .usdc, .usda, .usdz, .html, .zarr, .csv, .parquet or .wav;
        .ply (the rippling surfaces) or .glb (the scene) as it is at the latest frame; .meshes, a
        folder with such a file for each frame.
    fps : float
        Frames per second of the file.
    camera : str or CameraEntry, optional
        Name of a camera in the MJCF, or what `[camera]` of a scene file says; by default MuJoCo's
        free camera.
    looks : mapping, optional
        Geom, by its name or id, to the look of its surface, one of `LOOKS`; rubber by default, see
        `RippleRenderer`.
    colors : mapping, optional
        Geom, by its name or id, to the colour of its surface, sRGB from 0 to 1, instead of that of
        the model or the look.
    lighting : str
        "model", "studio" or "auto", see `Renderer`.
    tessellation : str
        "refined": surfaces with triangles as fine as their texels, or "own": the object's own.
    triangles : int
        About how many a refined surface may have; in a page at most 16,000.
    size : (width, height)
        Of the frames that the camera is meant for [pixels].
    limit : bool
        Whether heights that are too large for the object are written smaller, see
        `DisplacementLimit`.
    chunk : int, optional
        Frames in each of the files of a long USD run, which lie in a folder NAME.chunks beside it.
    replay : bool
        Write a page that plays recorded heights. By default a page solves the waves itself
        wherever it can, so that its surfaces can be poked.
    mesh_format : str
        "ply" or "glb", of the files in a folder of meshes.
    height_colors : float or "auto", optional
        Colour the surfaces in meshes by height, from blue to red: height at which the colours end
        [m], or "auto", the greatest in each file.
    overwrite : bool
        Replace a file that ripple-sim has not made.

    Raises
    ------
    RippleError
        If the ending is unknown or needs a package that is not installed, something foreign stands
        in the output's place, the ripples belong to another model, or an argument is invalid.

    Attributes
    ----------
    frames : int
        Written so far.
    output : Path
    """

    @checked(
        ExportError,
        output=PATH,
        fps=POSITIVE,
        ripples=instance(Ripples, ", for instance Ripples(model, materials)"),
        height_colors=HEIGHT_COLORS,
    )
    def __init__(
        self,
        model: mujoco.MjModel,
        ripples: Ripples,
        output: str | Path,
        *,
        fps: float = 60,
        camera: str | CameraEntry | None = None,
        looks: ByGeom[str] | None = None,
        colors: ByGeom[tuple[float, float, float]] | None = None,
        lighting: str = "auto",
        tessellation: str = "refined",
        triangles: int = MOST_TRIANGLES,
        size: tuple[int, int] = (1280, 720),
        limit: bool = True,
        chunk: int | None = None,
        replay: bool = False,
        mesh_format: Literal["ply", "glb"] = "ply",
        height_colors: float | Literal["auto"] | None = None,
        overwrite: bool = False,
    ) -> None:
        check_written(size, tessellation, triangles, chunk)
        check_mesh_format(mesh_format)
        source = loop_source(
            model,
            ripples,
            fps=fps,
            camera=camera,
            looks=looks,
            colors=colors,
            lighting=lighting,
            size=size,
            limit=limit,
            tessellation=tessellation,
            triangles=triangles,
            chunk=chunk or 0,
            output=Path(output),
            replay=replay,
            mesh_format=mesh_format,
            height_colors=height_colors,
        )
        self._begin(source, output, overwrite)

    @classmethod
    def of(cls, source: Source, output: str | Path, overwrite: bool = False) -> Self:
        """Exporter of a source."""
        exporter = cls.__new__(cls)
        exporter._begin(source, output, overwrite)
        return exporter

    def _begin(self, source: Source, output: str | Path, overwrite: bool) -> None:
        """Begin the file in a hidden folder beside the output."""
        self.output = Path(output)
        self.frames = 0
        self._source = source
        ending = check_export(
            self.output,
            overwrite,
            chunked=source.chunk > 0,
            colored=source.height_colors is not None,
        )
        with self._reported():
            self._place: Unfinished | None = Unfinished(self.output, ending.made_here, overwrite)
            try:
                self._writer = ending.writer(source, self._place.path)
            except BaseException:
                self._place.remove()
                raise

    def write(self, data: mujoco.MjData, impulses: Sequence[Impulse] | None = None) -> None:
        """Add the present state as a frame.

        Parameters
        ----------
        data : mujoco.MjData
            After `mj_step` or `mj_forward`. Where no poses were ever computed, those of its `qpos`
            are written.
        impulses : sequence of Impulse, optional
            All since the frame before; by default those of the latest step.

        Raises
        ------
        ExportError
            If the export is closed.
        EncodingError
            If it cannot be written, for instance on a full disk.
        """
        if self._place is None:
            raise ExportError(f"the export {self.output} is closed; make another Exporter")
        if impulses is None:
            impulses = self._source.ripples.last_impulses
        with self._reported():
            model = self._source.model
            state = posed(model, own_data(model, data, drawn=True))
            self._writer.write(self.frames, state, impulses)
        self.frames += 1

    def close(self) -> None:
        """Complete the file and move it to its place. Repeated calls do nothing.

        Raises
        ------
        ExportError
            If there is no frame, or something foreign stands in the file's place by now.
        EncodingError
            If it cannot be written.
        """
        if self._place is None:
            return
        try:
            if not self.frames:
                raise ExportError(f"the export {self.output} has no frame; write at least one")
            with self._reported():
                self._writer.finish()
                self._place.finish()
        finally:
            self.discard()

    @property
    def note(self) -> str:
        """What there is to know of the complete file, such as the scale of a sound."""
        return self._writer.note

    def discard(self) -> str:
        """Stop, and remove the unfinished file; say which files are kept for resuming, if any.

        An earlier file in the same place stays.
        """
        note = ""
        if self._place is not None:
            note = self._writer.close()
            self._place.remove()
            self._place = None
        return note

    def _repr_html_(self) -> str:
        """HTML for a notebook: the player of a complete page, or what was written."""
        complete = self._place is None and self.output.is_file()
        if complete and self.output.suffix.lower() == ".html":
            width, height = self._source.size
            return framed(self.output, width / height)
        state = "complete" if complete else "not complete"
        return f"<code>{html.escape(str(self.output))}</code>: {self.frames} frames, {state}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            self.close()
        else:
            note = self.discard()
            if note:
                error.add_note(note)

    @contextlib.contextmanager
    def _reported(self) -> Iterator[None]:
        """Add the name of the file to errors while it is written."""
        try:
            yield
        except OSError as error:
            raise EncodingError(f"cannot write {self.output}: {error.strerror or error}") from error


def loop_source(
    model: mujoco.MjModel,
    ripples: Ripples,
    *,
    camera: str | CameraEntry | None,
    looks: ByGeom[str] | None,
    colors: ByGeom[tuple[float, float, float]] | None = None,
    limit: bool = True,
    **settings: Any,
) -> Source:
    """The source of a loop of one's own.

    Parameters are as of `Exporter`; `settings` are fields of `Source`. Raises `RippleError` if the
    ripples belong to another model, or an argument is invalid.
    """
    model = own_model(model)
    check_targets(model, ripples.model, ripples.geom_ids)
    named = by_name(model, looks or {}, "looks")
    for look in named.values():
        find_look(look)
    paints = {
        name: paint_of(model, geom, named.get(name)) for name, geom in ripples.geom_ids.items()
    }
    for name, color in colors_by_name(model, colors).items():
        look, _ = paints[name]
        paints[name] = look, color
    return Source(
        model=model,
        ripples=ripples,
        camera=camera_entry(model, camera),
        paints=paints,
        limited=dict.fromkeys(ripples, limit),
        **settings,
    )


def camera_entry(model: mujoco.MjModel, camera: str | CameraEntry | None) -> CameraEntry:
    """A camera as `[camera]` of a scene file describes it; by default MuJoCo's free camera.

    Raises `SceneError` if the model does not have the camera, body or geom that it names.
    """
    if not isinstance(camera, CameraEntry):
        free = model.vis.global_
        camera = CameraEntry(
            name=camera, azimuth=free.azimuth, elevation=free.elevation, fovy=free.fovy
        )
    check_camera(model, camera)
    return camera


def framed(page: Path, aspect: float) -> str:
    """A page as HTML to be shown within another, `aspect` times as wide as high."""
    source = html.escape(page.read_text(encoding="utf-8"), quote=True)
    size = f'width="{round(_PAGE_HEIGHT * aspect)}" height="{_PAGE_HEIGHT}"'
    return (
        f'<iframe srcdoc="{source}" {size} style="border: 0; max-width: 100%" '
        f"allowfullscreen></iframe>"
    )


@dataclasses.dataclass(frozen=True)
class ExportSummary:
    """Number of frames of an export, and the times that it took [s].

    For pictures by Cycles `write_seconds` is the time that Cycles took. `note` says what else there
    is to know of the file: the scale of a sound, and up to which frequency it is right.
    """

    output: Path
    frames: int
    simulate_seconds: float
    write_seconds: float
    note: str = ""


@checked(
    ExportError,
    scene=instance(Scene, ", from load_scene or drop_scene"),
    output=PATH,
    options=instance(ExportOptions, ", for instance ExportOptions(fps=30)"),
)
def export_scene(
    scene: Scene,
    output: str | Path,
    options: ExportOptions = ExportOptions(),  # noqa: B008 - frozen
    *,
    progress: Callable[[int, int], None] | None = None,
    on_step: Callable[[Simulation], None] | None = None,
) -> ExportSummary:
    """Simulate a scene and write it to the file of another program.

    The same scene and options give the same numbers on the same machine. Memory does not grow with
    the duration. If an export in chunks is interrupted, the complete chunks stay in a folder beside
    the output, `output` with `.part` appended. An export that is resumed runs the simulation again
    up to the interruption and checks that it is the same.

    Parameters
    ----------
    scene : Scene
    output : path
        Its ending chooses the format, see `Exporter`. The file appears once it is complete.
    options : ExportOptions
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.
    on_step : callable, optional
        As for `Simulation`.

    Raises
    ------
    RippleError
        Before anything is simulated if the output, an option or the scene is invalid; later if the
        physics becomes unstable or the file cannot be written.
    """
    adopt_warnings()
    check_options(options)
    ending = check_export(
        Path(output),
        options.overwrite,
        chunked=options.chunk is not None,
        timed=options.time is not None,
        colored=options.height_colors is not None,
    )
    scene = through_camera(scene, options.camera)
    frames = frame_count(options, scene)
    simulation = Simulation.of(scene, options, on_step=on_step)
    if options.signals and not scene.sensors:
        raise ExportError(
            f"scene {scene.name!r} has no sensors; add a [[sensor]], or leave out --signals"
        )
    simulate_seconds = 0.0
    write_seconds = 0.0
    source = scene_source(scene, simulation, options)
    if ending.one_time:
        time_shown = options.time
        if time_shown is None:
            time_shown = frames / options.rate
        return _export_moment(simulation, source, Path(output), options, time_shown, progress)
    if options.chunk is not None:
        settings: Settings = {
            "the number of frames": frames,
            "the frame rate": options.fps,
            "the frames in a chunk": options.chunk,
            "the slow motion": options.slow_motion,
            "the tessellation": options.tessellation,
            "the number of triangles": options.triangles,
            "the size": "{}x{}".format(*options.size),
            **origin(scene, options),
        }
        source = dataclasses.replace(
            source,
            chunk=options.chunk,
            output=Path(output),
            settings=settings,
            resume=options.resume,
        )
    with Exporter.of(source, output, options.overwrite) as exporter:
        for number in range(frames):
            start = time.perf_counter()
            if number:
                simulation.advance_frame()
            done = time.perf_counter()
            exporter.write(simulation.data, simulation.impulses)
            simulate_seconds = simulate_seconds + done - start
            write_seconds = write_seconds + time.perf_counter() - done
            if progress is not None:
                progress(number + 1, frames)
    return ExportSummary(Path(output), frames, simulate_seconds, write_seconds, exporter.note)


def _export_moment(
    simulation: Simulation,
    source: Source,
    output: Path,
    options: ExportOptions,
    moment: float,
    progress: Callable[[int, int], None] | None,
) -> ExportSummary:
    """Simulate up to a moment [s], to within half a physics step, and write it."""
    check_duration(moment, 1.0)
    whole_frames = int(moment * options.rate * (1 + 1e-12))
    start = time.perf_counter()
    with Exporter.of(source, output, options.overwrite) as exporter:
        for number in range(whole_frames):
            simulation.advance_frame()
            if progress is not None:
                progress(number + 1, whole_frames)
        remaining = (moment - whole_frames / options.rate) / simulation.model.opt.timestep
        for _ in range(round(remaining)):
            simulation.step()
        done = time.perf_counter()
        exporter.write(simulation.data)
    return ExportSummary(output, 1, done - start, time.perf_counter() - done)


def scene_source(scene: Scene, simulation: Simulation, options: ExportOptions) -> Source:
    """The source of an export of a scene."""
    return Source(
        model=simulation.model,
        ripples=simulation.ripples,
        fps=options.fps,
        slow_motion=options.slow_motion,
        camera=scene.camera,
        size=options.size,
        lighting=scene.lighting,
        paints={entry.geom: (entry.look, entry.color) for entry in scene.targets},
        limited=simulation.limited,
        tessellation=options.tessellation,
        triangles=options.triangles,
        sensors={} if options.sound else simulation.sensors,
        signals=options.signals,
        replay=options.replay,
        mesh_format=options.mesh_format,
        height_colors=options.height_colors,
    )
