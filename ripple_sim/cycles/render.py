"""`render_cycles`: a scene simulated, written as USD, and rendered by Cycles."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ripple_sim.coupling.physics_messages import adopt_warnings
from ripple_sim.errors import ExportError, VideoError
from ripple_sim.export.endings import ending_of
from ripple_sim.export.exporter import Exporter
from ripple_sim.export.options import ExportOptions
from ripple_sim.export.scene import scene_source
from ripple_sim.scene.camera_override import with_exposure
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.video.open_video import open_video
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.settings import EXPOSURE, check_options, frame_count, settled

from .blender import frames_of_cycles, python_with_bpy
from .settings import blender_settings
from .tone_mapping import tone_mapped

Progress = Callable[[int, int], None]

SAMPLES = 64
_OURS_ALONE = ("compare", "overlay", "passes", "resume", "transparent")


@dataclasses.dataclass(frozen=True)
class CyclesSummary:
    """What a video by Cycles took: its frames, and times [s]."""

    output: Path
    frames: int
    export_seconds: float
    render_seconds: float


def render_cycles(
    scene: Scene,
    output: str | Path,
    options: VideoOptions = VideoOptions(),  # noqa: B008 - frozen
    *,
    samples: int = SAMPLES,
    progress: Progress | None = None,
) -> CyclesSummary:
    """Simulate a scene and write its video with frames by Cycles, of the same camera, lamps and looks.

    The run goes to a USD file in a temporary folder, which a process of Blender's own renders.

    Parameters
    ----------
    scene : Scene
    output : path
        As for `render_video`.
    options : VideoOptions
        Without overlays, passes, comparison, transparency and resuming.
    samples : int
        Paths a pixel.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Raises
    ------
    RippleError
        Before anything is simulated if bpy or usd-core is missing, an option is one of ours alone, or the output or
        the scene is invalid; later if Blender fails or the video cannot be written.
    """
    adopt_warnings()
    output = Path(output)
    python = check_cycles(options, output, samples)
    options = settled(dataclasses.replace(options, overlay=()), scene, output)
    scene = with_exposure(scene, **{name: getattr(options, name) for name in EXPOSURE})
    frames, start = frame_count(options), time.perf_counter()
    with (
        open_video(output, options) as writer,
        tempfile.TemporaryDirectory(prefix="ripple-sim-") as folder,
    ):
        stage = Path(folder) / "stage.usdc"
        settings = _export(scene, stage, options, frames)
        exported = time.perf_counter()
        told = {**settings, "stage": str(stage), "frames": frames, "samples": samples}
        for frame in frames_of_cycles(python, told, Path(folder)):
            writer.write(frame.astype(np.float16) if options.linear else tone_mapped(frame))
            if progress is not None:
                progress(writer.frames, frames)
    return CyclesSummary(output, frames, exported - start, time.perf_counter() - exported)


def check_cycles(options: VideoOptions, output: Path, samples: int = SAMPLES) -> str:
    """Make sure, before anything that takes time, that Cycles can render with these options; return its Python.

    Raises
    ------
    RippleError
    """
    for name in _OURS_ALONE:
        if getattr(options, name):
            raise VideoError(f"the renderer cycles has no --{name}; leave it out, or render with --renderer gl")
    if not isinstance(samples, int) or not 1 <= samples <= 65536:
        raise VideoError(f"there shall be {samples!r} samples; valid is a whole number from 1 to 65536")
    check_options(options, output)
    try:
        ending_of(Path("stage.usdc"))
    except ExportError as error:
        raise VideoError(f"the renderer cycles reads USD: {error}") from error
    return python_with_bpy()


def _export(scene: Scene, stage: Path, options: VideoOptions, frames: int) -> dict:
    """Write the run, and return what Blender is told beside it."""
    simulation = Simulation.of(scene, options)
    exported = ExportOptions(fps=options.fps or 1, slow_motion=options.slow_motion, size=options.size)
    source = scene_source(scene, simulation, exported)
    with Exporter.of(source, stage) as exporter:
        for number in range(frames):
            if number:
                simulation.advance_frame()
            else:
                settings = blender_settings(source, simulation.data)
            exporter.write(simulation.data, simulation.impulses)
    return settings
