"""Commands that show a scene or write it to a file: `render`, `drop`, `export` and `view`.

Commands that write a file show a progress bar on a terminal, which also says what is being
compiled. A pipe or a log gets a line for every tenth of a job that takes long.
"""

from __future__ import annotations

import contextlib
import dataclasses
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text
from tyro.conf import Positional, arg

from ripple_sim.errors import VideoError
from ripple_sim.export.options import ExportOptions
from ripple_sim.video.options import SceneOptions, VideoOptions

from . import arguments

if TYPE_CHECKING:
    from ripple_sim.scene.scene import Scene
    from ripple_sim.viewer.opening import Opened
    from ripple_sim.viewer.session import Session
    from ripple_sim.viewer.window import Window


# A job that ends within this time prints no progress into a pipe or a log [s].
_SILENT_TIME = 10.0

# A summary leaves out compilations that take less than this [s].
_MIN_COMPILE_TIME = 0.05


# The commands inherit fields, defaults and help texts from the options. A field is repeated here if
# its words on the command line are read in another way than its type says.
@dataclasses.dataclass(frozen=True, kw_only=True)
class _SceneCommand(SceneOptions):
    size: arguments.Size = SceneOptions.size
    duration: arguments.Duration = SceneOptions.duration
    slow_motion: arguments.Factor = SceneOptions.slow_motion
    resolution: arguments.Resolution = SceneOptions.resolution
    layout: arguments.SceneLayout = SceneOptions.layout
    rim: arguments.Rim = SceneOptions.rim
    camera: arguments.CameraName = SceneOptions.camera


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExportCommand(_SceneCommand, ExportOptions):
    """Simulate a scene, and write it to a file for other programs."""

    fps: arguments.Count = ExportOptions.fps
    triangles: arguments.Count = ExportOptions.triangles
    chunk: arguments.Limit = ExportOptions.chunk
    time: arguments.Time = ExportOptions.time
    height_colors: arguments.HeightColors = ExportOptions.height_colors
    scene: Annotated[Positional[str], arg(metavar="SCENE|MESH")]
    """Name of a shipped scene, path of a scene file (TOML), or a mesh (OBJ, OFF, PLY, STL, GLB
    ...). Bodies drop on a mesh."""
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """Output file. Its ending chooses the format: .usdc, .usda or .usdz (the moving scene), .html
    (a player), .zarr (fields over time), .csv or .parquet (impulses, or signals), .wav (signals, or
    sound), .ply (the rippling surfaces at one time), .glb (the scene at one time), .meshes (a
    folder of meshes, one a frame)."""
    seed: arguments.SceneSeed = None
    """Seed of the scene's random variation, or of the bodies that drop on a mesh."""

    def run(self) -> None:
        """Export the scene and print a summary."""
        from ripple_sim.export.place import check_export, check_options
        from ripple_sim.scene.drop import find_scene, is_scene

        is_scene(self.scene)
        options = ExportOptions(
            **{field.name: getattr(self, field.name) for field in dataclasses.fields(ExportOptions)}
        )
        check_options(options)  # before anything that takes time
        check_export(
            self.output,
            options.overwrite,
            timed=options.time is not None,
            colored=options.height_colors is not None,
        )

        from ripple_sim.export.exporter import export_scene
        from ripple_sim.video.settings import frame_count

        scene = find_scene(self.scene, seed=self.seed)
        for note in scene.notes:
            print(f"{Path(self.scene).name}: {note}", file=sys.stderr)
        with frame_progress(f"export to {self.output}", frame_count(options, scene)) as progress:
            summary = export_scene(scene, self.output, options, progress=progress)
        frames = "1 frame" if summary.frames == 1 else f"{summary.frames} frames"
        size = ""
        if summary.output.is_file():
            size = f", {summary.output.stat().st_size / 1e6:.1f} MB"
        print(
            f"{summary.output}: {frames}{size}\n"
            f"{_sound_line(summary.note)}"
            f"stages    simulation {summary.simulate_seconds:.1f} s, writing "
            f"{summary.write_seconds:.1f} s"
        )


def _sound_line(note: str) -> str:
    """The line of a summary on the sound, if there is any."""
    return f"sound     {note}\n" if note else ""


class _Rate(ProgressColumn):
    """The rate, or the kernels being compiled and the seconds so far."""

    def render(self, task: Task) -> Text:
        from ripple_sim.solver.compile_clock import compiling, stage_of

        module = compiling()
        if module is None:
            rate = f"{task.speed:.1f} frames/s" if task.speed else ""
            return Text(rate, style="progress.data.speed")
        stage = stage_of(module)
        return Text(f"compiling {stage} (once): {_compile_times()[stage]:.0f} s")


def _compile_times() -> dict[str, float]:
    """Time spent on compiling, by what the kernels compute [s]."""
    from ripple_sim.solver.compile_clock import compile_times, stage_of

    times: dict[str, float] = {}
    for module, seconds in compile_times().items():
        stage = stage_of(module)
        times[stage] = times.get(stage, 0.0) + seconds
    return times


def _progress_lines() -> Callable[[int, int], None]:
    """Make a progress function for a pipe or a log: it prints a line at each tenth.

    It prints nothing until the job has taken `_SILENT_TIME`.
    """
    start = time.monotonic()
    printed_tenths = 0

    def report(done: int, total: int) -> None:
        nonlocal printed_tenths
        tenths = 10 * done // total if total else 0
        if tenths > printed_tenths and time.monotonic() - start > _SILENT_TIME:
            printed_tenths = tenths
            print(
                f"ripple-sim: {10 * tenths} % done, {done} of {total} frames",
                file=sys.stderr,
                flush=True,
            )

    return report


@contextlib.contextmanager
def frame_progress(title: str, total: int | None = None) -> Iterator[Callable[[int, int], None]]:
    """Show the progress of a job on stderr while the block runs.

    Yields a function to call with the frames done and the number of all frames.

    A terminal gets a title, and below it frames done of a total, rate and remaining time. A pipe or
    a log gets a line at each tenth of a job that takes long.
    """
    if not sys.stderr.isatty():
        yield _progress_lines()
        return
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frames"),
        _Rate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.console.print(title, markup=False, highlight=False)
        task = progress.add_task("", total=total)
        yield lambda done, total: progress.update(task, completed=done, total=total)


@dataclasses.dataclass(frozen=True, kw_only=True)
class _VideoCommand(_SceneCommand, VideoOptions):
    fps: arguments.FrameRate = VideoOptions.fps
    supersample: arguments.Supersample = VideoOptions.supersample
    shutter: arguments.Shutter = VideoOptions.shutter
    aperture: arguments.Aperture = VideoOptions.aperture
    focus: arguments.Focus = None
    exposures: arguments.Exposures = VideoOptions.exposures
    passes: arguments.Passes = ()
    overlay: arguments.Overlay = None
    compare: arguments.Baseline = VideoOptions.compare
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """Output file: .mp4, .webm, .gif or .webp, or a name without an ending for a folder of
    frames."""
    device: arguments.Device = VideoOptions.device
    renderer: Literal["gl", "cycles"] = "gl"
    """gl is the OpenGL renderer. cycles is Blender's path tracer (needs bpy), at seconds to minutes
    a frame."""
    samples: arguments.Count = 64
    """Paths per pixel, for Cycles."""

    def options(self) -> VideoOptions:
        """The options of the video, as `VideoOptions`."""
        return VideoOptions(
            **{field.name: getattr(self, field.name) for field in dataclasses.fields(VideoOptions)}
        )

    def check_input(self) -> None:
        """Check that the scene or the mesh exists."""
        raise NotImplementedError

    def load(self) -> Scene:
        """Load or make the scene."""
        raise NotImplementedError

    def run(self) -> None:
        """Render the scene and print a summary."""
        self.check_input()  # before what this machine may lack
        if self.renderer == "cycles":
            self._run_cycles()
            return
        from ripple_sim.video.settings import check_options

        check_options(self.options(), self.output)  # before anything that takes time

        from ripple_sim.video.render_video import render_video
        from ripple_sim.video.settings import chosen_context, frame_count, settled

        scene = self.load()
        options = settled(self.options(), scene, self.output)
        title = f"renderer {chosen_context(options).renderer}, waves {options.backend}"
        with frame_progress(title, frame_count(options)) as progress:
            summary = render_video(scene, self.output, options, progress=progress)
        resumed = ""
        if summary.resumed_at:
            resumed = f", the first {summary.resumed_at} of them rendered before"
        compiling = ""
        if summary.compile_seconds >= _MIN_COMPILE_TIME:
            stages = [stage for stage, time in _compile_times().items() if time > _MIN_COMPILE_TIME]
            compiling = f"compiling {', '.join(stages)} (once) {summary.compile_seconds:.1f} s, "
        print(
            f"{summary.output}: {summary.frames} frames in {summary.wall_seconds:.1f} s{resumed}\n"
            f"renderer  {summary.renderer}\n"
            f"waves     {summary.backend}, {summary.substeps_per_frame:.1f} steps per frame\n"
            f"{_sound_line(summary.sound)}"
            f"stages    {compiling}set-up {summary.setup_seconds:.1f} s, physics "
            f"{summary.physics_seconds:.1f} s, waves {summary.wave_seconds:.1f} s, rendering "
            f"{summary.render_seconds:.1f} s, encoding {summary.encode_seconds:.1f} s"
        )

    def _run_cycles(self) -> None:
        """Render the scene with Cycles and print a summary."""
        from ripple_sim.cycles.render import check_cycles, render_cycles

        check_cycles(self.options(), self.output, self.samples)  # before anything that takes time

        from ripple_sim.video.settings import frame_count, settled

        scene = self.load()
        frames = frame_count(settled(self.options(), scene, self.output))
        with frame_progress(f"renderer Cycles, {self.samples} samples", frames) as progress:
            summary = render_cycles(
                scene, self.output, self.options(), samples=self.samples, progress=progress
            )
        print(f"{summary.output}: {summary.frames} frames")
        print(
            f"stages    simulation and export {summary.simulate_seconds:.1f} s, Cycles "
            f"{summary.write_seconds:.1f} s"
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class RenderCommand(_VideoCommand):
    """Render a scene to a video."""

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """Name of a shipped scene, such as duck, or path of a scene file (TOML)."""
    seed: arguments.SceneSeed = None
    """Seed of the scene's random variation. It replaces the seed in the [random] table."""

    def check_input(self) -> None:
        """Check that the scene exists."""
        from ripple_sim.scene.source import scene_path

        scene_path(self.scene)

    def load(self) -> Scene:
        """Load the scene."""
        from ripple_sim.scene.loading import load_scene

        return load_scene(self.scene, seed=self.seed)


@dataclasses.dataclass(frozen=True, kw_only=True)
class DropCommand(_VideoCommand):
    """Put a mesh on a floor, drop bodies on it, and render a video."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...)."""
    bodies: arguments.Count = 12
    """Number of falling bodies."""
    seed: arguments.Seed = 0
    """Seed of the places and sizes of the bodies. The same seed gives the same video."""
    up: arguments.UpAxis = None
    """Axis of the mesh that points up. By default a thin sheet lies down, and an unstable mesh is
    turned upright."""
    view: arguments.View = None
    """Where the camera stands, half-way through its turn of 5 degrees a second: on a side of the
    mesh, above it, or at an azimuth as in MuJoCo, 90 for the front."""
    elevation: arguments.Elevation = None
    """Elevation of the camera. Negative looks down."""
    look: Annotated[str, arg(metavar="NAME")] = "rubber"
    """What the mesh looks made of: rubber, jelly, skin, clay, metal, water or model."""
    color: arguments.RGB = None
    """Colour of the mesh (sRGB), in place of its texture and the colours of its vertices."""
    shapes: arguments.Shapes = None
    """Shapes of the bodies in turn: ball, box, capsule, ellipsoid, cylinder. Example: ball,box."""
    texture: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Image for the texture coordinates of the mesh. By default the image that the file names, or
    NAME_texture.png."""
    repair: bool = False
    """Close the holes of the mesh (needs the package pymeshfix)."""
    wrap: bool = False
    """Replace the mesh by a closed surface around it: for parts that intersect, or scans in
    pieces."""

    def check_input(self) -> None:
        """Check that the mesh exists."""
        from ripple_sim.solver.mesh.files import check_mesh_file

        check_mesh_file(self.mesh)

    def load(self) -> Scene:
        """Build a scene around the mesh."""
        from ripple_sim.scene.drop import drop_scene

        scene = drop_scene(
            self.mesh,
            bodies=self.bodies,
            seed=self.seed,
            up=self.up,
            view=self.view,
            elevation=self.elevation,
            look=self.look,
            color=self.color,
            shapes=self.shapes,
            texture=self.texture,
            repair=self.repair,
            wrap=self.wrap,
        )
        for note in scene.notes:
            print(f"{self.mesh.name}: {note}", file=sys.stderr)
        return scene


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewCommand:
    """Open a scene or a mesh in the browser, to poke it while it runs.

    Click: poke the surface; drag on it: poke it on. Drag a body: pull it. Drag: orbit. Shift and
    drag: pan. Wheel: zoom. Space: pause or resume. N: next frame. R: reset. T: throw a ball at the
    pointer. O: next operator (fem, uncorrected, paper). C: colours by height. S: screenshot. V:
    start or stop a recording. M: settings, with the material. H: list of keys, with --window. Q:
    quit. Where there is no screen, the address of the page is printed.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE|MESH")]
    """Name of a shipped scene, path of a scene file (TOML), or a mesh (OBJ, OFF, PLY, STL, GLB
    ...)."""
    size: arguments.Size = (800, 600)
    """Window size in pixels."""
    resolution: arguments.Count = 64
    """Texels along the edge of a chart. More texels resolve finer waves and take longer."""
    bodies: arguments.Seed = 3
    """Number of bodies that fall on a mesh. 0 for none."""
    seed: arguments.Seed = 0
    """Seed of the places and sizes of the bodies."""
    up: arguments.UpAxis = None
    """Axis of the mesh that points up. By default a thin sheet lies down, and an unstable mesh is
    turned upright."""
    repair: bool = False
    """Close the holes of the mesh (needs the package pymeshfix)."""
    wrap: bool = False
    """Replace the mesh by a closed surface around it: for parts that intersect, or scans in
    pieces."""
    folder: Annotated[Path, arg(metavar="FOLDER")] = Path()
    """Folder for screenshots and videos."""
    window: bool = False
    """Open a window of VTK's instead of a page in the browser."""
    web: bool = False
    """The page in the browser, which is the default now."""
    port: arguments.Count = 8080
    """Port of the page."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address of the page. Any address but 127.0.0.1 lets other machines see and control the
    viewer."""
    benchmark: bool = False
    """Measure the update rate of the window, print it, and exit."""

    def run(self) -> None:
        """Show the scene until the user quits."""
        from ripple_sim.encode.output import check_size
        from ripple_sim.scene.drop import is_scene
        from ripple_sim.viewer.opening import display_problem

        # checks come before anything that takes time: first the arguments, then the machine
        is_scene(self.scene)
        check_size(*self.size)
        if not self.folder.is_dir():
            raise VideoError(
                f"there is no folder {str(self.folder)!r} for screenshots and videos; make it first"
            )
        if self.benchmark:
            from ripple_sim.viewer.window import benchmark

            print(benchmark(self._window(off_screen=display_problem() is not None)))
        elif self.window:
            from ripple_sim.viewer.window import check_display, run

            check_display()
            run(self._window(off_screen=False))
        else:
            from ripple_sim.viewer.access import check_port
            from ripple_sim.viewer.page_server import show
            from ripple_sim.viewer.page_view import view_of

            check_port(self.port, self.host)
            opened = self._opened()
            session = self._session(opened)
            show(view_of(session, self.folder, self.resolution, opened), self.port, self.host)

    def _opened(self) -> Opened:
        """The scene or the mesh that the command names."""
        from ripple_sim.viewer.opening import opened

        return opened(
            self.scene,
            bodies=self.bodies,
            seed=self.seed,
            up=self.up,
            repair=self.repair,
            wrap=self.wrap,
        )

    def _session(self, opened: Opened, fps: int = 60, has_skins: bool = False) -> Session:
        from ripple_sim.viewer.session import Session

        return Session(opened.scene, fps=fps, resolution=self.resolution, has_skins=has_skins)

    def _window(self, off_screen: bool) -> Window:
        from ripple_sim.viewer.window import Window

        session = self._session(self._opened(), fps=30, has_skins=True)
        return Window(session, size=self.size, off_screen=off_screen, folder=self.folder)
