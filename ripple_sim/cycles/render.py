"""`render_cycles`: simulate a scene, write it as USD, and render it with Cycles.

Cycles runs in a Blender process of its own. The process gets the USD stage, and settings: frames,
sky, soft boxes, and the floor that fades into the sky. It returns linear radiance, which becomes a
frame's colours as in the OpenGL renderer.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib.resources
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import geom_name
from ripple_sim.coupling.hooks import adopt_warnings
from ripple_sim.errors import ExportError, VideoError
from ripple_sim.export.exporter import Exporter, ExportSummary, scene_source
from ripple_sim.export.options import ExportOptions
from ripple_sim.export.place import ending_of
from ripple_sim.export.source import Source
from ripple_sim.export.visuals import mean_color
from ripple_sim.render.passes.floor import find_floor
from ripple_sim.render.tone_mapping import tone_mapped
from ripple_sim.render.visuals.scene_light import lighting_of
from ripple_sim.render.visuals.studio import (
    BESIDE_LIGHTS,
    FADE,
    SOFT_BOX_LIGHTS,
    STUDIO_FADE,
    sky_colors,
)
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import geom_visual
from ripple_sim.scene.scene import Scene, through_camera, with_exposure
from ripple_sim.simulation import Simulation
from ripple_sim.solver.errors import warn_caller
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import Progress, open_video
from ripple_sim.video.settings import EXPOSURE, check_options, frame_count, settled

# Environment variable that names a Python with bpy.
PYTHON = "RIPPLE_SIM_BPY_PYTHON"

# Oldest version of bpy: before it, options of the USD importer have other names.
OLDEST = (5, 0)

# Characters of a process's last line that a message quotes, at most.
_MAX_REASON_LENGTH = 300

_ADVICE = (
    "on Python 3.13 install it with: pip install 'ripple-sim[cycles]'; otherwise give it an "
    "environment of its own (python3.11 -m venv blender; blender/bin/pip install 'bpy>=5.0') and "
    f"set {PYTHON}=blender/bin/python"
)

# Light that the renderer's soft boxes give to diffuse surfaces, over that of lights of their size
# and radiance.
_DIFFUSE_SHARE = 0.13 * np.pi / 4

# Paths per pixel.
SAMPLES = 64

# Options of a video that Cycles does not have.
_OPENGL_ONLY = ("sound", "compare", "overlay", "passes", "resume", "transparent")


def python_with_bpy() -> str:
    """Python that can import bpy: the one that the environment names, or this one.

    Raises `VideoError` if there is none, its bpy is too old, or cannot be imported.
    """
    named = os.environ.get(PYTHON)
    if named:
        if not os.access(named, os.X_OK):
            raise VideoError(
                f"{PYTHON} is {named!r}, which cannot be run; name a Python that has bpy"
            )
    elif importlib.util.find_spec("bpy") is None:
        raise VideoError(f"the renderer cycles needs bpy, which is not installed; {_ADVICE}")
    python = named or sys.executable
    version = _version_of_bpy(python)
    if version < OLDEST:
        oldest = ".".join(map(str, OLDEST))
        installed = ".".join(map(str, version))
        raise VideoError(f"{python} must have bpy {oldest} or later, got {installed}: {_ADVICE}")
    return python


@functools.cache  # asking takes most of a second
def _version_of_bpy(python: str) -> tuple[int, ...]:
    """Version of the bpy of a Python; raises `VideoError` if it cannot be imported."""
    code = "import bpy; print(*bpy.app.version)"
    process = subprocess.run(
        [python, "-c", code], capture_output=True, text=True, errors="replace", check=False
    )
    output = process.stdout if process.returncode == 0 else process.stderr
    last_line = output.strip().splitlines()[-1:]
    try:
        return tuple(map(int, last_line[0].split()))
    except (IndexError, ValueError):
        reason = "".join(last_line)[:_MAX_REASON_LENGTH] or f"status {process.returncode}"
        raise VideoError(f"{python} cannot import bpy: {reason}; {_ADVICE}") from None


def frames_of_cycles(
    python: str, settings: dict[str, Any], folder: Path
) -> Iterator[NDArray[np.float32]]:
    """Linear frames [height, width, 3], in their order, from a process of Blender's own.

    Parameters
    ----------
    python : str
        From `python_with_bpy`.
    settings : dict
        What blender_process.py reads.
    folder : Path
        For the files that pass between the processes.

    Raises
    ------
    VideoError
        If the process ends before the last frame.
    """
    settings_file = folder / "settings.json"
    errors = folder / "blender.log"
    text = json.dumps({**settings, "folder": str(folder)})
    settings_file.write_text(text, encoding="utf-8")
    # Blender leaves folders behind where temporary files go
    place = {**os.environ, "TMPDIR": str(folder)}
    with (
        importlib.resources.as_file(
            importlib.resources.files(__package__).joinpath("blender_process.py")
        ) as path,
        errors.open("wb") as log,
        subprocess.Popen(
            [python, str(path), str(settings_file)], stdout=subprocess.PIPE, stderr=log, env=place
        ) as process,
    ):
        try:
            for number in range(settings["frames"]):
                _wait_for(number, process, errors)
                file = folder / f"{number}.npy"
                yield np.load(file)
                file.unlink()
        finally:
            process.terminate()


def _wait_for(number: int, process: subprocess.Popen, errors: Path) -> None:
    """Read the lines of the process until it names the frame; other lines are Blender's own."""
    last_line = ""
    for line in process.stdout or ():
        text = line.decode(errors="replace").strip()
        if text == f"frame {number}":
            return
        last_line = text or last_line
    error_lines = errors.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    reason = error_lines[-1] if error_lines else last_line
    reason = reason[:_MAX_REASON_LENGTH] or "without a word"
    raise VideoError(f"Blender ended before frame {number} with status {process.wait()}: {reason}")


def blender_settings(source: Source, data: mujoco.MjData) -> dict[str, Any]:
    """Settings for the Blender process, as JSON can hold them.

    They are the light and background at the first frame, and the camera's shutter and size.
    """
    from pxr import Tf

    model = source.model
    pose = source.pose(data)
    if not pose.has_square_pixels(source.size[0] / source.size[1]):
        warn_caller(
            "Cycles shows the camera with square pixels, which it has not; ripple-sim render "
            "without --renderer cycles shows it as it is"
        )
    lighting = lighting_of(model, data, pose, source.lighting)
    studio = lighting.studio
    floor = find_floor(model, source.ripples.geom_ids.values())
    floor_name = None if floor is None else Tf.MakeValidIdentifier(geom_name(model, floor))
    albedo = None
    if floor is not None:
        visual = geom_visual(model, floor)
        albedo = visual.color * mean_color(model, mapping_of(model, visual))
    horizon, zenith, sky = sky_colors(lighting, pose, albedo, None)
    boxes = []
    for box in SOFT_BOX_LIGHTS:
        boxes.append(
            {
                "azimuth": box.azimuth,
                "elevation": box.elevation,
                "half": [box.half_width, box.half_height],
                "radiance": list(box.radiance),
            }
        )
    strength = 1.0 if studio else BESIDE_LIGHTS
    return {
        "size": list(source.size),
        "fps": source.fps,
        "shutter": source.camera.shutter / 360,
        "distance": pose.distance,
        "horizon": horizon.tolist(),
        "zenith": zenith.tolist(),
        "sky": sky.tolist(),
        "floor": floor_name,  # of its prim in the USD file
        "fade": list(STUDIO_FADE if studio else FADE),
        "boxes_reflected": strength,
        "boxes_diffuse": _DIFFUSE_SHARE * strength if studio else 0.0,
        "boxes": boxes,
    }


def render_cycles(
    scene: Scene,
    output: str | Path,
    options: VideoOptions = VideoOptions(),  # noqa: B008 - frozen
    *,
    samples: int = SAMPLES,
    progress: Progress | None = None,
) -> ExportSummary:
    """Simulate a scene, and write a video with frames rendered by Cycles.

    Camera, lamps and looks are those of the OpenGL renderer. The run goes to a USD file in a
    temporary folder, which a process of Blender's own renders.

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
        Before anything is simulated if bpy or usd-core is missing, an option is one of ours alone,
        or the output or the scene is invalid; later if Blender fails or the video cannot be
        written.
    """
    adopt_warnings()
    output = Path(output)
    python = check_cycles(options, output, samples)
    options = settled(dataclasses.replace(options, overlay=()), scene, output)
    scene = through_camera(scene, options.camera)
    scene = with_exposure(scene, **{name: getattr(options, name) for name in EXPOSURE})
    frames = frame_count(options)
    start = time.perf_counter()
    with (
        open_video(output, options) as writer,
        tempfile.TemporaryDirectory(prefix="ripple-sim-") as folder,
    ):
        stage = Path(folder) / "stage.usdc"
        simulation = Simulation.of(scene, options)
        exported_as = ExportOptions(
            fps=options.fps or 1, slow_motion=options.slow_motion, size=options.size
        )
        source = scene_source(scene, simulation, exported_as)
        settings = blender_settings(source, simulation.data)
        with Exporter.of(source, stage) as exporter:
            for number in range(frames):
                if number:
                    simulation.advance_frame()
                exporter.write(simulation.data, simulation.impulses)
        exported = time.perf_counter()
        settings |= {"stage": str(stage), "frames": frames, "samples": samples}
        for frame in frames_of_cycles(python, settings, Path(folder)):
            coded = (
                frame.astype(np.float16)
                if options.linear
                else np.rint(255 * tone_mapped(frame)).astype(np.uint8)
            )
            writer.write(coded)
            if progress is not None:
                progress(writer.frames, frames)
    return ExportSummary(output, frames, exported - start, time.perf_counter() - exported)


def check_cycles(options: VideoOptions, output: Path, samples: int = SAMPLES) -> str:
    """Check that Cycles can render with these options, before anything that takes time.

    Returns the Python interpreter that has bpy.

    Raises `RippleError`.
    """
    for name in _OPENGL_ONLY:
        if getattr(options, name):
            raise VideoError(
                f"the renderer cycles has no --{name}; leave it out, or render with --renderer gl"
            )
    if not isinstance(samples, int) or not 1 <= samples <= 65536:
        raise VideoError(f"samples must be a whole number from 1 to 65536, got {samples!r}")
    check_options(options, output)
    try:
        ending_of(Path("stage.usdc"))
    except ExportError as error:
        raise VideoError(f"the renderer cycles reads USD: {error}") from error
    return python_with_bpy()
