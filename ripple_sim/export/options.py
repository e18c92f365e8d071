"""`ExportOptions`: every option of an export, listed once for Python and for the command line.

It imports nothing heavy, so that the help of a command comes at once; `place` checks options.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

from ripple_sim.errors import ExportError
from ripple_sim.solver.errors import check_fields, whole
from ripple_sim.video.options import IN_ANY_CASE, Backend

TESSELLATIONS = ("refined", "own")
MOST_TRIANGLES = 100_000


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
    """What the rims of open surfaces do: free, supported, clamped, or fixed as that of a drum's skin."""
    backend: Backend = "auto"
    """Where waves are computed: with OpenGL, on the CPU, or wherever it is faster."""
    signals: bool = False
    """Write the samples of the scene's sensors, in place of impulses (.csv, .parquet)."""
    sound: bool = False
    """Write what is heard at the camera also where the scene has sensors (.wav)."""
    chunk: int | None = None
    """Frames in each of the files of a long USD run, which lie in a folder NAME.chunks beside it."""
    resume: bool = False
    """Keep the complete chunks of an interrupted export of the same scene with the same options."""
    overwrite: bool = False
    """Replace an output that ripple-sim has not made."""

    def __post_init__(self) -> None:
        check_fields(ExportError, self, triangles=whole(1), chunk=whole(1), **IN_ANY_CASE)

    @property
    def rate(self) -> float:
        """Frames in a second of the scene's time."""
        return self.fps * self.slow_motion
