"""`ripple-sim atlas`."""

from __future__ import annotations

import dataclasses
import json as json_format
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from .arguments import Count, LayoutName, UpAxis

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ripple_sim.solver import Atlas as SolverAtlas


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
    method: Annotated[str, arg(metavar="{progressive,conformal}")] = "progressive"
    """Sphere map of the cube: progressive (fold-free, even area) or conformal (preserves angles; starves limbs)."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write an image of the mesh with its charts, and of the charts, coloured by stretch; with --inside, of the
    thickness."""
    inside: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Tell how thick the layer is over what lies inside, a mesh or a volume (NIfTI, NRRD, DICOM folder, .npy)."""
    threshold: Annotated[float | None, arg(metavar="VALUE", help_behavior_hint="(optional)")] = None
    """Value of the volume inside at its surface."""
    spacing: Annotated[float | None, arg(metavar="M", help_behavior_hint="(optional)")] = None
    """Between the voxels of a .npy inside [m]."""
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
        from ripple_sim.solver import build_atlas, load_mesh, thickness_map

        from .atlas_report import atlas_report, report_text

        self._check()
        inside = None
        if self.inside is not None:
            from ripple_sim.scene.target_maps import load_inside

            inside = load_inside(self.inside, self.threshold, self.spacing)
        start = time.perf_counter()
        mesh = load_mesh(self.mesh, repair=self.repair, wrap=self.wrap)
        loaded = time.perf_counter()
        atlas = build_atlas(mesh, resolution=self.resolution, method=self.method, layout=self.layout)
        seconds = {"load": loaded - start, **atlas.timings}
        thickness = None
        if inside is not None:
            begun = time.perf_counter()
            thickness = thickness_map(atlas, inside)
            seconds["thickness"] = time.perf_counter() - begun
        if self.output is not None:
            atlas.save(self.output, self.overwrite)
        if self.plot is not None:
            begun = time.perf_counter()
            self._plot(self.plot, atlas, thickness)
            seconds["plot"] = time.perf_counter() - begun
        report = atlas_report(self.mesh, atlas, self.method, seconds, thickness)
        print(json_format.dumps(report, indent=2) if self.json else report_text(report))

    def _check(self) -> None:
        """Refuse, before anything that takes time, what cannot be written or makes no sense."""
        from ripple_sim.solver import AtlasError
        from ripple_sim.solver.mesh.files import check_mesh_file
        from ripple_sim.solver.texels.atlas import check_atlas_place

        check_mesh_file(self.mesh)
        for path in (self.output, self.plot):
            for read in filter(None, (self.mesh, self.inside)):
                if path is not None and path.exists() and read.exists() and path.samefile(read):
                    what = "the mesh itself" if read == self.mesh else "what is inside itself"
                    raise AtlasError(f"cannot write {path}: it is {what}; name another file")
        if self.inside is None and (self.threshold is not None or self.spacing is not None):
            raise AtlasError("--threshold and --spacing belong to the volume that --inside names; name one")
        if self.output is not None:
            check_atlas_place(self.output, self.overwrite)
        if self.plot is not None:
            from ripple_sim.figures.plot_page import check_plot_path

            check_plot_path(self.plot, self.overwrite)

    def _plot(self, path: Path, atlas: SolverAtlas, thickness: NDArray[np.float64] | None) -> None:
        from ripple_sim.figures.atlas_plot import plot_atlas
        from ripple_sim.figures.thickness_plot import plot_thickness
        from ripple_sim.scene.up_axis import usual_up

        from .atlas_report import charts_text

        mesh, up = atlas.mesh, self.up or usual_up(self.mesh)
        method = self.method if atlas.layout == "cube" else None
        subtitle = f"{len(mesh.V):,} vertices, {len(mesh.F):,} triangles; {charts_text(atlas.texels.shape, method)}"
        if thickness is None:
            plot_atlas(atlas, path, title=self.mesh.stem, subtitle=subtitle, up=up)
        else:
            subtitle = f"thickness over {self.inside.name if self.inside else ''}; {subtitle}"
            plot_thickness(atlas, thickness, path, title=self.mesh.stem, subtitle=subtitle, up=up)
