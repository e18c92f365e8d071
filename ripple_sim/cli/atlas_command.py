"""`ripple-sim atlas`."""

from __future__ import annotations

import dataclasses
import json as json_format
import time
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from .arguments import Count, LayoutName, UpAxis


@dataclasses.dataclass(frozen=True, kw_only=True)
class Atlas:
    """Map a mesh to an atlas of charts and report its quality."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...)."""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE", help_behavior_hint="(optional)")] = None
    """Save the atlas to this file (NPZ)."""
    resolution: Count = 128
    """Texels along the edge of a cube's chart, N: about 6 N^2 in all, in every layout."""
    layout: LayoutName = "auto"
    """Cube (closed, in one part, without handles), patches (any mesh), or auto: cube where it fits."""
    method: Annotated[str, arg(metavar="METHOD")] = "progressive"
    """Sphere map of the cube: progressive (fold-free, even area) or conformal (preserves angles; starves limbs)."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write an image of the mesh with its charts, and of the charts, coloured by stretch."""
    up: UpAxis = None
    """Axis of the mesh that points up in the image."""
    repair: bool = False
    """Close the mesh's holes (needs the package pymeshfix)."""
    wrap: bool = False
    """Take a closed surface round the mesh: for parts that pass through each other, or scans in pieces."""
    json: bool = False
    """Print JSON."""
    overwrite: bool = False
    """Replace files that ripple-sim has not made; the mesh itself never."""

    def run(self) -> None:
        """Build the atlas, save and plot it if asked to, and print its figures."""
        from ripple_sim.solver import AtlasError, build_atlas, load_mesh
        from ripple_sim.solver.texels.atlas_file import check_atlas_place

        from .atlas_report import atlas_report, charts_text, report_text

        # before anything that takes time
        for path in (self.output, self.plot):
            if path is not None and path.exists() and self.mesh.exists() and path.samefile(self.mesh):
                raise AtlasError(f"cannot write {path}: it is the mesh itself; name another file")
        if self.output is not None:
            check_atlas_place(self.output, self.overwrite)
        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import check_plot_path

            check_plot_path(self.plot, self.overwrite)
        start = time.perf_counter()
        mesh = load_mesh(self.mesh, repair=self.repair, wrap=self.wrap)
        loaded = time.perf_counter()
        atlas = build_atlas(mesh, resolution=self.resolution, method=self.method, layout=self.layout)
        seconds = {"load": loaded - start, **atlas.timings}
        method = self.method if atlas.layout == "cube" else None
        if self.output is not None:
            atlas.save(self.output, self.overwrite)
        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import plot_atlas
            from ripple_sim.scene.up_axis import usual_up

            begun = time.perf_counter()
            subtitle = f"{len(mesh.V):,} vertices, {len(mesh.F):,} triangles; {charts_text(atlas.texels.shape, method)}"
            plot_atlas(atlas, self.plot, title=self.mesh.stem, subtitle=subtitle, up=self.up or usual_up(self.mesh))
            seconds["plot"] = time.perf_counter() - begun
        report = atlas_report(self.mesh, atlas, self.method, seconds)
        print(json_format.dumps(report, indent=2) if self.json else report_text(report))
