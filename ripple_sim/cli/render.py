"""`ripple-sim render` and `ripple-sim drop`."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from .arguments import Count, Device, SceneSeed, Seed, UpAxis
from .video_arguments import VideoArguments

if TYPE_CHECKING:
    from ripple_sim.scene.scene import Scene
    from ripple_sim.video.summary import Summary


@dataclasses.dataclass(frozen=True, kw_only=True)
class _VideoCommand(VideoArguments):
    camera: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: the scene's)")] = None
    """Camera of the MJCF to render from."""
    device: Device = None
    """EGL device to render on, by number, where there are several."""
    renderer: Literal["gl", "cycles"] = "gl"
    """Ours, with OpenGL, or Cycles, Blender's path tracer (needs bpy), which takes seconds to minutes a frame."""
    samples: Count = 64
    """Paths a pixel that Cycles takes."""

    def check_input(self) -> None:
        """Make sure that what is to be rendered exists."""
        raise NotImplementedError

    def load(self) -> Scene:
        """Make the scene that is rendered."""
        raise NotImplementedError

    def run(self) -> None:
        """Render the scene and print a summary."""
        self.check_input()  # before what this machine may lack
        if self.renderer == "cycles":
            self._run_cycles()
        else:
            self._run_gl()

    def _run_gl(self) -> None:
        from ripple_sim.video.settings import check_options

        check_options(self.options(), self.output)  # before anything that takes time

        from ripple_sim.solver.gl import select_device, shared_context
        from ripple_sim.video.render_video import render_video
        from ripple_sim.video.settings import frame_count, settled

        from .progress import frame_progress

        if self.device is not None:
            select_device(self.device)
        scene = self._seen()
        options = settled(self.options(), scene, self.output)
        title = f"renderer {shared_context().renderer}, waves {options.backend}"
        with frame_progress(title, frame_count(options)) as progress:
            summary = render_video(scene, self.output, options, progress=progress)
        print(_summary_text(summary))

    def _run_cycles(self) -> None:
        from ripple_sim.cycles.render import check_cycles, render_cycles

        check_cycles(self.options(), self.output, self.samples)  # before anything that takes time

        from ripple_sim.video.settings import frame_count, settled

        from .progress import frame_progress

        scene = self._seen()
        frames = frame_count(settled(self.options(), scene, self.output))
        with frame_progress(f"renderer Cycles, {self.samples} samples", frames) as progress:
            summary = render_cycles(scene, self.output, self.options(), samples=self.samples, progress=progress)
        print(f"{summary.output}: {summary.frames} frames")
        print(f"stages    simulation and export {summary.export_seconds:.1f} s, Cycles {summary.render_seconds:.1f} s")

    def _seen(self) -> Scene:
        """The scene through the camera that is asked for."""
        from ripple_sim.scene.camera_override import through_camera

        scene = self.load()
        return scene if self.camera is None else through_camera(scene, self.camera)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Render(_VideoCommand):
    """Render a scene to a video."""

    scene: Annotated[Positional[str], arg(metavar="SCENE")]
    """Name of a shipped scene, such as duck, or path of a scene file (TOML)."""
    seed: SceneSeed = None
    """Seed of the scene's random variation, in place of the one in its [random]."""

    def check_input(self) -> None:
        """Make sure that there is such a scene."""
        from ripple_sim.scene.scene_path import scene_path

        scene_path(self.scene)

    def load(self) -> Scene:
        """Load the scene."""
        from ripple_sim.scene.load_scene import load_scene

        return load_scene(self.scene, seed=self.seed)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drop(_VideoCommand):
    """Put a mesh on a floor, drop bodies on it, and render a video."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...)."""
    bodies: Count = 12
    """Number of falling bodies."""
    seed: Seed = 0
    """Seed for the bodies' places and sizes; the same seed gives the same video."""
    up: UpAxis = None
    """Axis of the mesh that points up; a flat sheet lies down."""
    texture: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Image in the mesh's own texture coordinates; by default the one that the file names, or NAME_texture.png."""
    repair: bool = False
    """Close the mesh's holes (needs the package pymeshfix)."""
    wrap: bool = False
    """Take a closed surface round the mesh: for parts that pass through each other, or scans in pieces."""

    def check_input(self) -> None:
        """Make sure that there is such a file."""
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
            texture=self.texture,
            repair=self.repair,
            wrap=self.wrap,
        )
        for note in scene.notes:
            print(f"{self.mesh.name}: {note}", file=sys.stderr)
        return scene


def _summary_text(summary: Summary) -> str:
    resumed = f", the first {summary.resumed_at} of them rendered before" if summary.resumed_at else ""
    compiling = f"compiling (once) {summary.compile_seconds:.1f} s, " if summary.compile_seconds >= 0.05 else ""
    return (
        f"{summary.output}: {summary.frames} frames in {summary.wall_seconds:.1f} s{resumed}\n"
        f"renderer  {summary.renderer}\n"
        f"waves     {summary.backend}, {summary.substeps_per_frame:.1f} steps per frame\n"
        f"stages    {compiling}set-up {summary.setup_seconds:.1f} s, physics {summary.physics_seconds:.1f} s, "
        f"waves {summary.wave_seconds:.1f} s, rendering {summary.render_seconds:.1f} s, "
        f"encoding {summary.encode_seconds:.1f} s"
    )
