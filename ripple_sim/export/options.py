"""`ExportOptions`: every option of an export, listed once for Python and for the command line.

The module imports nothing heavy, so that the help of a command comes at once; `place` checks the
options.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

from ripple_sim.errors import ExportError
from ripple_sim.solver.errors import POSITIVE, Valid, check_fields, is_finite, whole
from ripple_sim.video.options import IN_ANY_CASE, SceneOptions

TESSELLATIONS = ("refined", "own")
MESH_FORMATS = ("ply", "glb")
MOST_TRIANGLES = 100_000  # of a refined surface, about, by default

HEIGHT_COLORS = Valid(
    lambda limit: limit is None or limit == "auto" or POSITIVE.holds(limit),
    "'auto', or a number of metres greater than 0",
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExportOptions(SceneOptions):
    """How a scene is exported.

    The docstring of a field is its help on the command line. None leaves an option to the scene.
    """

    fps: int = 60
    """Frames per second."""
    size: tuple[int, int] = (1280, 720)
    """Size in pixels of the frames that the camera is meant for."""
    tessellation: Literal["refined", "own"] = "refined"
    """Triangles of rippling surfaces: as fine as their texels, or the object's own."""
    triangles: int = MOST_TRIANGLES
    """About how many triangles a refined surface may have; a page has at most 16,000."""
    time: float | None = None
    """Second of the scene that a .ply or .glb shows. By default the end."""
    mesh_format: Literal["ply", "glb"] = "ply"
    """Format of the files in a folder NAME.meshes."""
    height_colors: float | Literal["auto"] | None = None
    """Colour rippling surfaces by height in meshes, from blue to red: metres at which the colours
    end, or auto, the greatest height in each file."""
    signals: bool = False
    """Write the samples of the scene's sensors instead of impulses (.csv, .parquet)."""
    sound: bool = False
    """Write the sound at the camera even if the scene has sensors (.wav)."""
    replay: bool = False
    """Write a page that plays recorded heights, and does not solve the waves itself (.html)."""
    chunk: int | None = None
    """Frames in each of the files of a long USD run, which lie in a folder NAME.chunks beside
    it."""
    resume: bool = False
    """Keep the complete chunks of an interrupted export of the same scene with the same options."""

    def __post_init__(self) -> None:
        check_fields(
            ExportError,
            self,
            triangles=whole(1),
            chunk=whole(1),
            time=Valid(lambda time: is_finite(time) and time >= 0, "0 s or more"),
            height_colors=HEIGHT_COLORS,
            **IN_ANY_CASE,
        )
