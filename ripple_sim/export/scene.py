"""`export_scene`: a scene simulated, and written to the file of another program."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

from ripple_sim.coupling.stepping import adopt_warnings
from ripple_sim.errors import ExportError
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver.errors import PATH, checked, instance
from ripple_sim.video.settings import origin

from .exporter import Exporter
from .options import ExportOptions
from .place import check_export, check_options, frame_count
from .source import Chunking, Source

Progress = Callable[[int, int], None]


@dataclasses.dataclass(frozen=True)
class ExportSummary:
    """What an export took: frames, points on rippling surfaces, and times [s]."""

    output: Path
    frames: int
    simulate_seconds: float
    write_seconds: float


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
    progress: Progress | None = None,
    on_step: Callable[[Simulation], None] | None = None,
) -> ExportSummary:
    """Simulate a scene and write it to the file of another program.

    The same scene and options give the same numbers on the same machine. Memory does not grow with the duration. In
    chunks, the complete ones stay in a folder beside the output, `output` with `.part` appended, if the export is
    interrupted. Resumed, the simulation runs again up to there and is checked to be the same.

    Parameters
    ----------
    scene : Scene
    output : path
        Its ending says what is written, see `Exporter`. The file appears once it is complete.
    options : ExportOptions
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.
    on_step : callable, optional
        As for `Simulation`.

    Raises
    ------
    RippleError
        Before anything is simulated if the output, an option or the scene is invalid; later if the physics becomes
        unstable or the file cannot be written.
    """
    adopt_warnings()
    check_options(options)
    check_export(Path(output), options.overwrite, chunked=options.chunk is not None)
    frames = frame_count(options, scene)
    simulation = Simulation.of(scene, options, on_step=on_step)
    simulated = written = 0.0
    source = scene_source(scene, simulation, options)
    if options.chunk is not None:
        settings = _settings(scene, options, frames)
        source = dataclasses.replace(
            source, chunking=Chunking(options.chunk, Path(output), settings, resume=options.resume)
        )
    with Exporter.of(source, output, options.overwrite) as exporter:
        for number in range(frames):
            start = time.perf_counter()
            if number:
                simulation.advance_frame()
            done = time.perf_counter()
            exporter.write(simulation.data, simulation.impulses)
            simulated, written = simulated + done - start, written + time.perf_counter() - done
            if progress is not None:
                progress(number + 1, frames)
    return ExportSummary(Path(output), frames, simulated, written)


def scene_source(scene: Scene, simulation: Simulation, options: ExportOptions) -> Source:
    """What is recorded of a scene."""
    ripples = simulation.ripples
    return Source(
        model=simulation.model,
        ripples=ripples,
        fps=options.fps,
        slow_motion=options.slow_motion,
        camera=scene.camera,
        size=options.size,
        lighting=scene.lighting,
        paints={entry.geom: (entry.look, entry.color) for entry in scene.targets},
        limited=simulation.limited,
        tessellation=options.tessellation,
        triangles=options.triangles,
    )


def _settings(scene: Scene, options: ExportOptions, frames: int) -> dict[str, str | int | float]:
    """What decides the content of an export, by the names in messages."""
    return {
        "the number of frames": frames,
        "the frame rate": options.fps,
        "the frames in a chunk": options.chunk or 0,
        "the slow motion": options.slow_motion,
        "the tessellation": options.tessellation,
        "the number of triangles": options.triangles,
        "the size": "{}x{}".format(*options.size),
        "the resolution": options.resolution or "the scene's",
        "the layout": options.layout or "the scene's",
        "the rims": options.rim or "the scene's",
        "the wave solver": options.backend,
        **origin(scene),
    }
