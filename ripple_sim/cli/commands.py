"""The commands, one class each: the fields are the arguments, the docstrings the help, `run` does the work.

What is heavy is imported where it is used, so that `--help` and mistakes are answered at once.
"""

from __future__ import annotations

import dataclasses
import json as json_format
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from .arguments import (
    Aperture,
    Baseline,
    Count,
    Device,
    Duration,
    Exposures,
    Factor,
    Focus,
    FrameRate,
    Overlay,
    Resolution,
    Seed,
    Shutter,
    Size,
    Supersample,
    UpAxis,
)
from .completion_command import Completion
from .view_command import View

if TYPE_CHECKING:
    from ripple_sim.scene.scene import Scene
    from ripple_sim.solver import Mesh
    from ripple_sim.video.render_video import Summary


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Video:
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """Name of the video, ending in .mp4, .webm, .gif or .webp, or without ending for a folder of frames."""
    size: Size = (1280, 720)
    """Frame size in pixels."""
    fps: FrameRate = None
    """Frames per second."""
    duration: Duration = None
    """How many seconds of the scene are shown."""
    slow_motion: Factor = 1.0
    """Seconds of video for a second of the scene: 4 is four times slower."""
    supersample: Supersample = 1
    """Draw frames so many times as wide and high, and average: finer edges and highlights."""
    shutter: Shutter = None
    """Shutter angle in degrees, for motion blur: 180 leaves the shutter open for half of the time between frames."""
    aperture: Aperture = None
    """Diameter of the lens in metres, for depth of field."""
    focus: Focus = None
    """What is sharp: a distance in metres, or a body or a geom by its name."""
    exposures: Exposures = None
    """A frame is the mean of so many pictures, where shutter or aperture blur it; more are smoother and take longer."""
    transparent: bool = False
    """Leave the background out (.webp and folders of frames)."""
    frame_format: Literal["png", "exr"] = "png"
    """Frames of a folder: PNG, or EXR for linear light, not tone-mapped, without overlays (needs OpenEXR)."""
    overlay: Overlay = None
    """Draw over the picture: height or velocity in colours, contacts, grid, time, energy; such as
    height,contacts,time or velocity=0.5,energy, where 0.5 m/s is the end of the colours."""
    compare: Baseline = None
    """Show beside it the same scene with this other wave operator."""
    camera: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: the scene's)")] = None
    """Look through this camera of the MJCF."""
    resolution: Resolution = None
    """Texels along an edge of a cube face; more carry finer waves and take longer."""
    backend: Literal["auto", "gl", "cpu"] = "auto"
    """Where the waves are computed: in OpenGL, on the CPU, or wherever it is faster."""
    device: Device = None
    """Number of the EGL device that draws, where there are several."""
    resume: bool = False
    """Carry on where the same command was interrupted, if it was."""

    def load(self) -> Scene:
        """Make the scene that is rendered."""
        raise NotImplementedError

    def run(self) -> None:
        """Render the scene and print a summary."""
        from ripple_sim.encode import check_output, default_fps
        from ripple_sim.overlay.comparison import compared_operators
        from ripple_sim.scene.overlays import parse_request

        # Before anything that takes time.
        if self.overlay is not None:
            parse_request(self.overlay)
        compared_operators(self.compare)
        fps = self.fps or default_fps(self.output)
        check_output(
            self.output,
            *self.size,
            fps,
            transparent=self.transparent,
            frame_format=self.frame_format,
            overlaid=bool(self.overlay) or self.compare is not None,
        )

        from ripple_sim.capture.viewpoint import through_camera
        from ripple_sim.solver.backends.backend import auto_backend
        from ripple_sim.solver.gl import select_device, shared_context
        from ripple_sim.video.render_video import render_video

        from .progress import frame_progress

        if self.device is not None:
            select_device(self.device)
        scene = self.load()
        if self.camera is not None:
            scene = through_camera(scene, self.camera)
        backend = auto_backend() if self.backend == "auto" else self.backend
        with frame_progress(f"renderer {shared_context().renderer}, waves {backend}") as progress:
            summary = render_video(
                scene,
                self.output,
                size=self.size,
                fps=fps,
                duration=self.duration,
                slow_motion=self.slow_motion,
                supersample=self.supersample,
                shutter=self.shutter,
                aperture=self.aperture,
                focus=self.focus,
                exposures=self.exposures,
                transparent=self.transparent,
                frame_format=self.frame_format,
                overlay=self.overlay,
                compare=self.compare,
                resolution=self.resolution,
                backend=backend,
                resume=self.resume,
                progress=progress,
            )
        print(_summary_text(summary))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Render(_Video):
    """Render a scene to a video."""

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """Name of a shipped scene, such as duck, or path of a scene file (TOML)."""

    def load(self) -> Scene:
        """Load the scene."""
        from ripple_sim.scene.scene import load_scene

        return load_scene(self.scene)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drop(_Video):
    """Put any closed mesh on a floor, let bodies rain on it, and render that."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...): closed, in one part, without handles."""
    bodies: Count = 12
    """How many bodies fall."""
    seed: Seed = 0
    """Chooses where and what falls; the same seed gives the same video."""
    up: UpAxis = None
    """Axis of the mesh that points up."""
    texture: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Picture in the mesh's own texture coordinates; by default the one that the file names, or NAME_texture.png."""
    repair: bool = False
    """Mend a mesh that is open or not manifold (needs the package pymeshfix)."""

    def load(self) -> Scene:
        """Build a scene round the mesh."""
        from ripple_sim.scene.drop import drop_scene

        return drop_scene(
            self.mesh, bodies=self.bodies, seed=self.seed, up=self.up, texture=self.texture, repair=self.repair
        )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Atlas:
    """Map a mesh to a cube-map atlas, and say how good it is."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...): closed, in one part, without handles."""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE", help_behavior_hint="(optional)")] = None
    """Save the atlas to this file (NPZ)."""
    resolution: Count = 128
    """Texels along an edge of a cube face."""
    method: Annotated[str, arg(metavar="METHOD")] = "progressive"
    """Sphere map: progressive (fold-free, spreads the area evenly) or conformal (keeps angles; starves limbs)."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write a picture of the mesh, the sphere and the six faces, coloured by stretch."""
    up: UpAxis = None
    """Axis of the mesh that points up in the picture."""
    repair: bool = False
    """Mend a mesh that is open or not manifold (needs the package pymeshfix)."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Build the atlas, save and draw it where that is asked for, and print its figures."""
        from ripple_sim.scene.up_axis import usual_up
        from ripple_sim.solver import build_atlas, load_mesh

        from .atlas_report import atlas_report, report_text

        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import check_plot_path

            check_plot_path(self.plot)  # before anything that takes time
        start = time.perf_counter()
        mesh = load_mesh(self.mesh, repair=self.repair)
        loaded = time.perf_counter()
        atlas = build_atlas(mesh, resolution=self.resolution, method=self.method)
        seconds = {"load": loaded - start, **atlas.timings}
        if self.output is not None:
            atlas.save(self.output)
        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import plot_atlas

            begun = time.perf_counter()
            plot_atlas(
                atlas, self.plot, title=self.mesh.stem, subtitle=self._subtitle(mesh), up=self.up or usual_up(self.mesh)
            )
            seconds["plot"] = time.perf_counter() - begun
        report = atlas_report(self.mesh, atlas, self.method, seconds)
        print(json_format.dumps(report, indent=2) if self.json else report_text(report))

    def _subtitle(self, mesh: Mesh) -> str:
        n = self.resolution
        return f"{len(mesh.V):,} vertices, {len(mesh.F):,} triangles; 6 x {n} x {n} texels, {self.method} sphere map"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Info:
    """Show versions, the OpenGL driver and the wave solver, and what to install if rendering cannot work."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the report."""
        from ripple_sim.diagnostics.info import as_text, collect

        info = collect()
        print(json_format.dumps(dataclasses.asdict(info), indent=2) if self.json else as_text(info))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure the wave solver: speed against a memory copy and others, accuracy against theory and exact geodesics."""

    meshes: Annotated[Positional[tuple[Path, ...]], arg(metavar="MESH", help_behavior_hint="(optional)")] = ()
    """Meshes on which to measure times of arrival, besides one of our own."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Measure and print; what is being measured is told on stderr."""
        import sys

        from ripple_sim.bench.report import as_text, measure

        report = measure(list(self.meshes), lambda stage: print(f"measuring {stage} ...", file=sys.stderr))
        print(json_format.dumps(report, indent=2) if self.json else as_text(report))


COMMANDS: dict[str, Callable[..., Any]] = {
    "render": Render,
    "drop": Drop,
    "atlas": Atlas,
    "info": Info,
    "bench": Bench,
    "view": View,
    "completion": Completion,
}


def _summary_text(summary: Summary) -> str:
    resumed = f", the first {summary.resumed_at} of them before" if summary.resumed_at else ""
    return (
        f"{summary.output}: {summary.frames} frames in {summary.wall_seconds:.1f} s{resumed}\n"
        f"renderer  {summary.renderer}\n"
        f"waves     {summary.backend}, {summary.substeps_per_frame:.1f} steps a frame\n"
        f"stages    set-up {summary.setup_seconds:.1f} s, physics {summary.physics_seconds:.1f} s, "
        f"waves {summary.wave_seconds:.1f} s, rendering {summary.render_seconds:.1f} s, "
        f"encoding {summary.encode_seconds:.1f} s"
    )
