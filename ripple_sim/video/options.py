"""`VideoOptions`: every option of a video, listed once for Python and for the command line.

Exports share the options of `SceneOptions`. The module imports nothing heavy, so that the help of a
command comes at once. `settings` checks the options and replaces those that are left open.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Literal

from ripple_sim.errors import VideoError
from ripple_sim.solver.errors import POSITIVE, Valid, check_fields, is_finite, whole

Backend = Literal["auto", "gl", "cpu"]

# Checks that hold for every output and scene; further checks follow when these are known.
IN_ANY_CASE = {
    "size": Valid(
        lambda size: min(size) > 0, "(width, height) in pixels, two whole numbers greater than 0"
    ),
    "fps": whole(1),
    "duration": POSITIVE,
    "slow_motion": POSITIVE,
    "resolution": whole(1),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """How a scene is run for a video or an export: options that both have."""

    size: tuple[int, int] = (1280, 720)
    """Frame size in pixels."""
    fps: int | None = None
    """Frames per second."""
    duration: float | None = None
    """Seconds of the scene."""
    camera: str | None = None
    """Name of a camera in the MJCF."""
    slow_motion: float = 1.0
    """Seconds of the output per second of the scene: 4 is four times slower."""
    resolution: int | None = None
    """Texels along the edge of a cube's chart; more resolve finer waves and take longer."""
    layout: str | None = None
    """How surfaces get their charts: cube (closed, one part, no handles), patches (any), or
    auto."""
    rim: str | None = None
    """What the rims of open surfaces do: free, supported, clamped, or fixed as that of a drum's
    skin."""
    backend: Backend = "auto"
    """Where waves are computed: with OpenGL, on the CPU, or wherever it is faster."""
    overwrite: bool = False
    """Replace an output that ripple-sim has not made."""

    @property
    def rate(self) -> float:
        """Frames in a second of the scene's time."""
        if self.fps is None:
            raise ValueError("the frame rate depends on the output: settle the options first")
        return self.fps * self.slow_motion


@dataclasses.dataclass(frozen=True, kw_only=True)
class VideoOptions(SceneOptions):
    """How a scene is rendered to a video.

    The docstring of a field is its help on the command line. None leaves an option to the scene or
    to the output.
    """

    supersample: int = 1
    """Render at this many times the width and height and average: finer edges and highlights."""
    shutter: float | None = None
    """Shutter angle in degrees, for motion blur: 180 keeps the shutter open for half the time
    between frames."""
    aperture: float | None = None
    """Lens diameter in metres, for depth of field."""
    focus: float | str | tuple[float, float, float] | None = None
    """Focus: a distance in metres along the camera's axis, or the name of a body or geom."""
    exposures: int | None = None
    """Exposures averaged per frame where shutter or aperture blur it; more are smoother and take
    longer."""
    transparent: bool = False
    """Leave out the background (.webp and folders of frames)."""
    frame_format: Literal["png", "exr"] = "png"
    """Format of the frames in a folder: PNG, or EXR for linear light, without tone mapping or
    overlays (needs OpenEXR)."""
    passes: Sequence[str] = ()
    """Passes beside every frame, in a folder NAME.passes: depth, normal, segmentation, flow,
    position, height. Example: depth,flow."""
    pass_format: Literal["npz", "exr"] = "npz"
    """Format of the passes: NumPy's, or EXR (needs OpenEXR)."""
    overlay: Sequence[str] | None = None
    """Overlays on the video: height or velocity as a heatmap, contacts, grid, time, energy,
    sensors. Examples: height,contacts,time or velocity=0.5,energy, where the colours end at 0.5
    m/s."""
    sound: bool = False
    """Add the sound at the camera to the video (.mp4 and .webm)."""
    compare: str | None = None
    """Also run the scene with this wave operator and show both side by side."""
    resume: bool = False
    """Continue an interrupted render of the same scene with the same options."""
    device: int | None = None
    """Number of the EGL device to render on. By default the device in MUJOCO_EGL_DEVICE_ID, if it
    is set."""

    def __post_init__(self) -> None:
        check_fields(
            VideoError,
            self,
            supersample=whole(1),
            shutter=Valid(lambda angle: 0 <= angle <= 360, "0 to 360 degrees"),
            aperture=Valid(lambda metres: is_finite(metres) and metres >= 0, "0 m or more"),
            exposures=whole(1),
            device=whole(0),
            **IN_ANY_CASE,
        )

    @property
    def linear(self) -> bool:
        """Whether frames are linear light, float16; otherwise sRGB, uint8."""
        return self.frame_format == "exr"
