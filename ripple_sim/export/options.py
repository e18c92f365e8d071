"""`ExportOptions`: every option of an export, listed once for Python and for the command line, and checked."""

from __future__ import annotations

import dataclasses
from typing import Literal, TypedDict

from ripple_sim.encode.output import check_size
from ripple_sim.errors import ExportError, SceneError
from ripple_sim.scene.scene import MAX_DURATION, Scene
from ripple_sim.solver.errors import shown

TESSELLATIONS = ("refined", "own")
MOST_TRIANGLES = 100_000

Backend = Literal["auto", "gl", "cpu"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """How a scene is exported.

    The docstring of a field is its help on the command line. None leaves an option to the scene.
    """

    fps: int = 60
    """Frames per second."""
    duration: float | None = None
    """Seconds of the scene to export."""
    slow_motion: float = 1.0
    """Seconds of the file per second of the scene: 4 is four times slower."""
    tessellation: Literal["refined", "own"] = "refined"
    """Triangles of rippling surfaces: as fine as their texels, or the object's own."""
    triangles: int = MOST_TRIANGLES
    """About how many triangles a refined surface may have."""
    size: tuple[int, int] = (1280, 720)
    """Size in pixels of the frames that the camera is meant for."""
    resolution: int | None = None
    """Texels along the edge of a cube's chart; more resolve finer waves and take longer."""
    layout: str | None = None
    """How surfaces get their charts: cube (closed, one part, no handles), patches (any), or auto."""
    rim: str | None = None
    """What the rims of open surfaces do: free, or fixed as that of a drum's skin."""
    backend: Backend = "auto"
    """Where waves are computed: with OpenGL, on the CPU, or wherever it is faster."""
    chunk: int | None = None
    """Frames in each of the files of a long USD run, which lie in a folder NAME.chunks beside it."""
    resume: bool = False
    """Keep the complete chunks of an interrupted export of the same scene with the same options."""
    overwrite: bool = False
    """Replace an output that ripple-sim has not made."""

    @property
    def rate(self) -> float:
        """Frames in a second of the scene's time."""
        return self.fps * self.slow_motion


class WriteOptions(TypedDict, total=False):
    """Options of an export in anybody's own loop; see `Exporter`."""

    tessellation: str
    triangles: int
    size: tuple[int, int]
    limit: bool
    chunk: int | None
    overwrite: bool


WRITE_OPTIONS: WriteOptions = {
    "tessellation": "refined",
    "triangles": MOST_TRIANGLES,
    "size": (1280, 720),
    "limit": True,
    "chunk": None,
    "overwrite": False,
}


MAX_FPS, MAX_SLOW_MOTION, LARGEST_MESH = 1000, 1000, 10_000_000


def check_options(options: ExportOptions) -> None:
    """Make sure that the options are possible, before anything that takes time.

    Raises
    ------
    RippleError
    """
    if not isinstance(options.fps, int) or not 1 <= options.fps <= MAX_FPS:
        raise ExportError(f"frame rate is {options.fps!r}; valid is a whole number from 1 to {MAX_FPS} frames a second")
    if options.resume and options.chunk is None:
        raise ExportError("only an export in chunks can be resumed; add --chunk, or leave --resume out")
    check_write_options(
        {
            "size": options.size,
            "tessellation": options.tessellation,
            "triangles": options.triangles,
            "chunk": options.chunk,
        }
    )


def check_write_options(options: WriteOptions) -> None:
    """Make sure that there are such options, and that their values are possible.

    Raises
    ------
    RippleError
    """
    if unknown := [name for name in options if name not in WRITE_OPTIONS]:
        raise ExportError(f"there is no option {unknown[0]!r}; valid are {', '.join(WRITE_OPTIONS)}")
    given = WRITE_OPTIONS | options
    check_size(*given["size"])
    triangles, tessellation, chunk = given["triangles"], given["tessellation"], given["chunk"]
    if not isinstance(triangles, int) or not 1 <= triangles <= LARGEST_MESH:
        raise ExportError(f"there shall be {shown(triangles)} triangles; valid is a whole number, 1 to {LARGEST_MESH}")
    if chunk is not None and (not isinstance(chunk, int) or chunk < 1):
        raise ExportError(f"a chunk shall have {shown(chunk)} frames; valid is a whole number from 1")
    if tessellation not in TESSELLATIONS:
        raise ExportError(f"tessellation is {shown(tessellation)}; valid are {' and '.join(map(repr, TESSELLATIONS))}")


def frame_count(options: ExportOptions, scene: Scene) -> int:
    """Frames of a scene's export.

    Raises
    ------
    SceneError
        If the duration or the slow motion is out of range.
    """
    duration = scene.duration if options.duration is None else options.duration
    if not 0 < duration < MAX_DURATION:
        raise SceneError(f"duration is {duration!r} s; valid is a positive number, less than {MAX_DURATION}")
    if not 0 < options.slow_motion <= MAX_SLOW_MOTION:
        raise SceneError(f"slow motion is {options.slow_motion!r}; valid is a positive number up to {MAX_SLOW_MOTION}")
    return max(1, round(duration * options.fps * options.slow_motion))
