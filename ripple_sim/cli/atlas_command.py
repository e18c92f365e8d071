"""`ripple-sim atlas`."""

from __future__ import annotations

import dataclasses
import json as json_format
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from .arguments import Count, UpAxis

if TYPE_CHECKING:
    from ripple_sim.solver import Mesh


@dataclasses.dataclass(frozen=True, kw_only=True)
class Atlas:
    """Map a mesh to a cube-map atlas and report its quality."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...): closed, in one part, without handles."""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE", help_behavior_hint="(optional)")] = None
    """Save the atlas to this file (NPZ)."""
    resolution: Count = 128
    """Texels along the edge of a chart."""
    method: Annotated[str, arg(metavar="METHOD")] = "progressive"
    """Sphere map: progressive (fold-free, even area) or conformal (preserves angles; starves limbs of texels)."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write an image of the mesh, the sphere and the six charts, coloured by stretch."""
    up: UpAxis = None
    """Axis of the mesh that points up in the image."""
    repair: bool = False
    """Close the mesh's holes (needs the package pymeshfix)."""
    wrap: bool = False
    """Take a closed surface round the mesh: for parts that pass through each other, or scans in pieces."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Build the atlas, save and plot it if asked to, and print its figures."""
        from ripple_sim.solver import build_atlas, load_mesh

        from .atlas_report import atlas_report, report_text

        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import check_plot_path

            check_plot_path(self.plot)  # before anything that takes time
        start = time.perf_counter()
        mesh = load_mesh(self.mesh, repair=self.repair, wrap=self.wrap)
        loaded = time.perf_counter()
        atlas = build_atlas(mesh, resolution=self.resolution, method=self.method)
        seconds = {"load": loaded - start, **atlas.timings}
        if self.output is not None:
            atlas.save(self.output)
        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import plot_atlas
            from ripple_sim.scene.up_axis import usual_up

            begun = time.perf_counter()
            plot_atlas(
                atlas, self.plot, title=self.mesh.stem, subtitle=self._subtitle(mesh), up=self.up or usual_up(self.mesh)
            )
            seconds["plot"] = time.perf_counter() - begun
        report = atlas_report(self.mesh, atlas, self.method, seconds)
        print(json_format.dumps(report, indent=2) if self.json else report_text(report))

    def _subtitle(self, mesh: Mesh) -> str:
        n = self.resolution
        return f"{len(mesh.V):,} vertices, {len(mesh.F):,} triangles; 6 x {n} x {n} texels, {self.method} sphere map"
