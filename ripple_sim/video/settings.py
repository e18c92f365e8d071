"""The options of a video, checked and completed for one render.

The settings of a render, with fingerprints of its scene, its files and the software, decide whether
an interrupted render can continue.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import msgspec
import mujoco
import numpy as np

from ripple_sim import __version__
from ripple_sim.encode import check_output, default_fps
from ripple_sim.encode.formats import video_format
from ripple_sim.encode.part import Settings
from ripple_sim.encode.passes import check_passes
from ripple_sim.errors import VideoError
from ripple_sim.overlay.operators import compared_operators
from ripple_sim.scene.overlays import parse_request
from ripple_sim.scene.scene import Scene, check_duration
from ripple_sim.solver.backends.choice import auto_backend
from ripple_sim.solver.gl import GLContext, select_device, shared_context

from .options import Backend, SceneOptions, VideoOptions

# Options that replace the ones of the scene's camera with the same names.
EXPOSURE = ("shutter", "aperture", "focus", "exposures")


def origin(scene: Scene, options: SceneOptions) -> dict[str, str | int]:
    """Settings that the waves of a video or an export depend on, by the names in messages.

    It consists of options, the fingerprint of the scene and the versions of packages.
    """
    return {
        "the resolution": options.resolution or "the scene's",
        "the layout": options.layout or "the scene's",
        "the rims": options.rim or "the scene's",
        "the wave solver": options.backend,
        "the scene's fingerprint": scene_digest(scene),
        **{f"the version of {package}": number for package, number in versions().items()},
    }


@functools.cache
def versions() -> dict[str, str]:
    """Versions of the packages on which frames depend, by name."""
    # MuJoCo is installed as `mujoco` or as `mujoco-core`
    return {
        "ripple-sim": __version__,
        "mujoco": mujoco.__version__,
        **{package: version(package) for package in ("numpy", "numba", "moderngl", "av", "pillow")},
    }


def scene_digest(scene: Scene) -> str:
    """Fingerprint of the model, the surfaces, the camera and the script, 16 hexadecimal digits.

    Of files the contents count, not the paths: a scene in another folder has the same fingerprint.
    """
    hasher = hashlib.blake2b(digest_size=8)
    _add_fields(hasher, scene.model)
    sensors = [scene.sensors] if scene.sensors else []
    entries = msgspec.json.encode(
        (scene.targets, scene.camera, scene.events, scene.two_way, *sensors)
    )
    for path in itertools.chain.from_iterable(entry.files() for entry in scene.targets):
        # the content of a file counts, and not its path
        entries = entries.replace(msgspec.json.encode(path), b'""')
        is_folder = Path(path).is_dir()
        files = sorted(Path(path).rglob("*")) if is_folder else [Path(path)]
        for file in files:
            if file.is_file():
                hasher.update(file.read_bytes())
    hasher.update(entries)
    return hasher.hexdigest()


def _add_fields(hasher: Any, struct: Any) -> None:
    """Add the fields of a struct of MuJoCo.

    The paths of its files are left out, and its size in memory, which depends on the paths.
    """
    for name in dir(struct):
        if name.startswith("_") or "path" in name or name == "nbuffer":
            continue
        value = getattr(struct, name)
        if isinstance(value, int | float | bytes | np.ndarray):
            hasher.update(name.encode() + np.asarray(value).tobytes())
        elif type(value).__module__.startswith("mujoco") and not callable(value):
            _add_fields(hasher, value)


def settled(options: VideoOptions, scene: Scene, output: Path) -> VideoOptions:
    """The options with values in place of None and "auto": those of the scene, output and machine.

    Shutter, aperture, focus and exposures stay as they are: see `with_exposure`. Raises
    `VideoError` for an output of unknown format.
    """
    # before anything else: `default_fps` refuses an unknown format
    fps = default_fps(output) if options.fps is None else options.fps
    backend = options.backend
    if backend == "auto":  # the largest target of known resolution decides
        resolutions = [options.resolution or entry.resolution for entry in scene.targets]
        texel_counts = [6 * n * n for n in resolutions if n is not None]
        backend = cast(Backend, auto_backend(max(texel_counts)) if texel_counts else auto_backend())
    return dataclasses.replace(
        options,
        fps=fps,
        duration=scene.duration if options.duration is None else options.duration,
        overlay=tuple(scene.overlay if options.overlay is None else options.overlay),
        backend=backend,
    )


def chosen_context(options: VideoOptions) -> GLContext:
    """The OpenGL context of the device that the options name."""
    if options.device is not None:
        select_device(options.device)
    return shared_context()


def render_settings(scene: Scene, options: VideoOptions, frames: int, gl: GLContext) -> Settings:
    """Settings that the pixels of a video depend on, by the names in messages.

    The options are settled, and the scene has the exposure that they ask for.
    """
    width, height = options.size
    optional: dict[str, str | int | float] = {}
    if options.passes:
        optional["the passes"] = f"{','.join(options.passes)} in {options.pass_format}"
    if options.sound:
        optional["the sound"] = "at the camera"
    if options.linear:
        optional["the version of OpenEXR"] = version("OpenEXR")
    return {
        "the size": f"{width}x{height}",
        "the frame rate": options.fps or 0,
        "the number of frames": frames,
        "the slow motion": options.slow_motion,
        "the supersampling": options.supersample,
        "the camera's shutter": scene.camera.shutter,
        "the camera's aperture": scene.camera.aperture,
        "the camera's focus": str(scene.camera.focus or "the point that the camera looks at"),
        "the camera's exposures": scene.camera.exposures,
        "transparency": options.transparent,
        "the frame format": options.frame_format,
        "the overlays": ",".join(options.overlay or ()),
        "the operators": ",".join(compared_operators(options.compare)),
        **origin(scene, options),
        "the OpenGL driver": f"{gl.renderer}, {gl.version}",
        **optional,
    }


def check_options(options: VideoOptions, output: Path) -> None:
    """Check that a video with these options can be written to `output`; raise `RippleError` if not.

    Call it before anything that takes time.
    """
    parse_request(options.overlay or ())
    operators = compared_operators(options.compare)
    check_output(
        output,
        *options.size,
        default_fps(output) if options.fps is None else options.fps,
        transparent=options.transparent,
        frame_format=options.frame_format,
        overlaid=bool(options.overlay) or len(operators) > 1,
        overwrite=options.overwrite,
    )
    if options.sound and video_format(output) not in (".mp4", ".webm"):
        raise VideoError(
            f"{output} has no sound: write .mp4 or .webm, or use `ripple-sim export SCENE -o "
            "FILE.wav`"
        )
    if options.sound and len(operators) > 1:
        raise VideoError("two runs side by side have no sound; leave out --sound or --compare")
    if options.passes:
        check_passes(output, tuple(options.passes), options.pass_format, options.overwrite)
        if len(operators) > 1:
            raise VideoError("passes cannot be written with --compare; leave one of the two out")


def frame_count(options: SceneOptions, scene: Scene | None = None) -> int:
    """Frames of a video with settled options, or of an export of a scene.

    Raises `SceneError` if the duration or the slow motion is out of range.
    """
    duration = options.duration
    if duration is None and scene is not None:
        duration = scene.duration
    check_duration(duration or 0.0, options.slow_motion)
    return max(1, round((duration or 0.0) * (options.fps or 0) * options.slow_motion))
