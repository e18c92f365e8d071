"""`ripple-sim export`."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from ripple_sim.export.options import ExportOptions

from .arguments import Count, Duration, Factor, Limit, Resolution, Rim, SceneLayout, SceneSeed, Size

# By field: how its word on the command line is read. The others are read as their types say.
_WORDS: dict[str, Any] = {
    "fps": Count,
    "duration": Duration,
    "slow_motion": Factor,
    "triangles": Count,
    "chunk": Limit,
    "size": Size,
    "resolution": Resolution,
    "layout": SceneLayout,
    "rim": Rim,
}

if TYPE_CHECKING:
    _ExportFields = ExportOptions
else:
    _ExportFields = dataclasses.make_dataclass(
        "_ExportFields", list(_WORDS.items()), bases=(ExportOptions,), frozen=True, kw_only=True
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Export(_ExportFields):
    """Simulate a scene, and write it to the file of another program."""

    scene: Annotated[Positional[str], arg(metavar="SCENE|MESH")]
    """Name of a shipped scene, path of a scene file (TOML), or a mesh (OBJ, OFF, PLY, STL, GLB ...), on which bodies
    then drop."""
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """Output file; its ending says what is written: .usdc, .usda or .usdz (the moving scene), .html (a player),
    .zarr (fields over time), .csv or .parquet (impulses)."""
    camera: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: the scene's)")] = None
    """Camera of the MJCF."""
    seed: SceneSeed = None
    """Seed of the scene's random variation, or of the bodies that drop on a mesh."""

    def run(self) -> None:
        """Export the scene and print a summary."""
        from ripple_sim.export.endings import check_export
        from ripple_sim.export.settings import check_options
        from ripple_sim.scene.find_scene import find_scene, is_scene

        is_scene(self.scene)
        options = ExportOptions(**{each.name: getattr(self, each.name) for each in dataclasses.fields(ExportOptions)})
        check_options(options)  # before anything that takes time
        check_export(self.output, options.overwrite)

        from ripple_sim.export.scene import export_scene
        from ripple_sim.export.settings import frame_count
        from ripple_sim.scene.camera_override import through_camera

        from .progress import frame_progress

        scene = find_scene(self.scene, seed=self.seed)
        for note in scene.notes:
            print(f"{Path(self.scene).name}: {note}", file=sys.stderr)
        if self.camera is not None:
            scene = through_camera(scene, self.camera)
        with frame_progress(f"export to {self.output}", frame_count(options, scene)) as progress:
            summary = export_scene(scene, self.output, options, progress=progress)
        print(
            f"{summary.output}: {summary.frames} frames\n"
            f"stages    simulation {summary.simulate_seconds:.1f} s, writing {summary.write_seconds:.1f} s"
        )
