"""Commands on a mesh: `atlas` reports the quality of its charts, and `modes` how it rings.

The report of an atlas describes the mesh and its repairs, the quality of the atlas, and the time
of each stage.
"""

from __future__ import annotations

import dataclasses
import json as json_format
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from tyro.conf import Positional, arg

from .arguments import Count, LayoutName, NamedMaterial, RimName, UpAxis

if TYPE_CHECKING:
    from ripple_sim.solver import Atlas, Modes

# Label and unit in the text for each figure of `Atlas.quality`.
_FIGURES = {
    "solid_angle": ("solid angle of the map", "sr"),
    "flipped": ("folded triangles", ""),
    "q001": ("stretch, 0.1 % of the area", ""),
    "q01": ("stretch, 1 %", ""),
    "q50": ("stretch, median", ""),
    "q99": ("stretch, 99 %", ""),
    "q999": ("stretch, 99.9 %", ""),
    "starved": ("area starved (stretch over 4)", ""),
    "edge_min": ("shortest texel edge", "m"),
    "edge_max": ("longest texel edge", "m"),
    "folded": ("folded texels", ""),
    "coverage": ("texel area / mesh area", ""),
    "spanned": ("area between texels / mesh area", ""),
    "timestep": ("time step / even grid's", ""),
}

# Quantiles of the thickness of a layer that a report has, by name.
_THICKNESS_QUANTILES = {"least": 0.0, "q01": 0.01, "median": 0.5, "q99": 0.99, "greatest": 1.0}


@dataclasses.dataclass(frozen=True, kw_only=True)
class AtlasCommand:
    """Map a mesh to an atlas of charts and report its quality."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...)."""
    output: Annotated[
        Path | None, arg(aliases=["-o"], metavar="FILE", help_behavior_hint="(optional)")
    ] = None
    """Save the atlas to this file (NPZ)."""
    resolution: Count = 128
    """Texels along the edge of a cube's chart, N. Every layout has about 6 N^2 texels in all."""
    layout: LayoutName = "auto"
    """Layout of the charts: cube (for a closed mesh in one part without handles), patches (any
    mesh), or auto, which takes the cube for round bodies."""
    method: Annotated[str, arg(metavar="{progressive,conformal}")] = "progressive"
    """Sphere map of the cube layout: progressive (even areas, no folds) or conformal (keeps angles,
    but gives limbs few texels)."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write an image of the mesh and its charts, coloured by stretch, or with --inside by
    thickness."""
    inside: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="(optional)")] = None
    """Report the thickness of the layer between the mesh and this one inside it, or this volume
    (NIfTI, NRRD, DICOM folder, .npy)."""
    threshold: Annotated[float | None, arg(metavar="VALUE", help_behavior_hint="(optional)")] = None
    """Value at the surface of the object in the volume."""
    spacing: Annotated[float | None, arg(metavar="M", help_behavior_hint="(optional)")] = None
    """Distance between the voxels of a .npy volume [m]."""
    up: UpAxis = None
    """Axis of the mesh that points up in the image."""
    repair: bool = False
    """Close the holes of the mesh (needs the package pymeshfix)."""
    wrap: bool = False
    """Replace the mesh by a closed surface around it: for parts that intersect, or scans in
    pieces."""
    json: bool = False
    """Print JSON."""
    overwrite: bool = False
    """Replace files that ripple-sim has not made. The mesh itself is never replaced."""

    def run(self) -> None:
        """Build the atlas, save and plot it if requested, and print its figures."""
        from ripple_sim.solver import build_atlas, load_mesh, thickness_map

        self._check()
        inside = None
        if self.inside is not None:
            from ripple_sim.scene.target_maps import load_inside

            inside = load_inside(self.inside, self.threshold, self.spacing)
        start = time.perf_counter()
        mesh = load_mesh(self.mesh, repair=self.repair, wrap=self.wrap)
        seconds = {"load": time.perf_counter() - start}
        atlas = build_atlas(
            mesh, resolution=self.resolution, method=self.method, layout=self.layout
        )
        seconds |= atlas.timings
        thickness = None
        if inside is not None:
            start = time.perf_counter()
            thickness = thickness_map(atlas, inside)
            seconds["thickness"] = time.perf_counter() - start
        if self.output is not None:
            atlas.save(self.output, self.overwrite)
        if self.plot is not None:
            start = time.perf_counter()
            self._plot(self.plot, atlas, thickness)
            seconds["plot"] = time.perf_counter() - start
        report = atlas_report(self.mesh, atlas, self.method, seconds, thickness)
        print(json_format.dumps(report, indent=2) if self.json else report_text(report))

    def _check(self) -> None:
        """Check paths and options before anything that takes time."""
        from ripple_sim.solver import AtlasError
        from ripple_sim.solver.mesh.files import check_mesh_file
        from ripple_sim.solver.texels.atlas_file import check_atlas_place

        check_mesh_file(self.mesh)
        for path in filter(None, (self.output, self.plot)):
            _check_other(path, self.mesh, "the mesh")
            _check_other(path, self.inside, "what is inside")
        if self.inside is None and (self.threshold is not None or self.spacing is not None):
            raise AtlasError(
                "--threshold and --spacing belong to the volume that --inside names; name one"
            )
        if self.output is not None:
            check_atlas_place(self.output, self.overwrite)
        if self.plot is not None:
            from ripple_sim.figures.figure_file import check_plot_path

            check_plot_path(self.plot, self.overwrite)

    def _plot(self, path: Path, atlas: Atlas, thickness: NDArray[np.float64] | None) -> None:
        from ripple_sim.figures.atlas_plot import plot_atlas
        from ripple_sim.figures.thickness_plot import plot_thickness
        from ripple_sim.scene.standing import usual_up

        mesh = atlas.mesh
        up = self.up or usual_up(self.mesh)
        method = self.method if atlas.layout == "cube" else None
        subtitle = (
            f"{len(mesh.V):,} vertices, {len(mesh.F):,} triangles; "
            f"{charts_text(atlas.texels.shape, method)}"
        )
        if thickness is None:
            plot_atlas(atlas, path, title=self.mesh.stem, subtitle=subtitle, up=up)
        else:
            subtitle = f"thickness over {self.inside.name if self.inside else ''}; {subtitle}"
            plot_thickness(atlas, thickness, path, title=self.mesh.stem, subtitle=subtitle, up=up)


def _check_other(output: Path, source: Path | None, content: str) -> None:
    """Check that an output is not the file that is read, which holds `content`."""
    from ripple_sim.solver import AtlasError

    if source is None or not (output.exists() and source.exists()):
        return
    if output.samefile(source):
        raise AtlasError(f"cannot write {output}: it is {content} itself; name another file")


def atlas_report(
    path: Path,
    atlas: Atlas,
    method: str,
    seconds: dict[str, float],
    thickness: NDArray[np.float64] | None = None,
) -> dict[str, Any]:
    """Figures of an atlas, as JSON can hold them.

    The mesh has a `size` (of its bounding box [m]), an `area` [m^2], a `volume` [m^3], and `notes`
    on its repairs and on the choice of its layout. The atlas has `charts` (C, n, n), the `method`
    of the cube's sphere map, and a `quality` (see `Atlas.quality`). `thickness` has quantiles of
    the thickness of a layer [m], and `seconds` the wall time of each stage [s].
    """
    mesh = atlas.mesh
    optional: dict[str, Any] = {}
    if thickness is not None:
        quantiles = np.quantile(thickness, list(_THICKNESS_QUANTILES.values())).tolist()
        optional["thickness"] = dict(zip(_THICKNESS_QUANTILES, quantiles, strict=True))
    return {
        "mesh": str(path),
        "vertices": len(mesh.V),
        "triangles": len(mesh.F),
        "size": np.ptp(mesh.V, axis=0).tolist(),
        "area": mesh.area,
        "volume": mesh.volume,
        "notes": [*mesh.notes, *atlas.notes],
        "resolution": atlas.resolution,
        "layout": atlas.layout,
        "method": method if atlas.layout == "cube" else None,
        "charts": list(atlas.texels.shape),
        "quality": atlas.quality(),
        **optional,
        "seconds": seconds,
    }


def charts_text(shape: Sequence[int], method: str | None) -> str:
    """Describe charts of shape (C, n, n) as text, and the sphere map of the cube layout."""
    layout = "patches" if method is None else f"{method} sphere map"
    return f"{' x '.join(map(str, shape))} texels, {layout}"


def report_text(report: dict[str, Any]) -> str:
    """Format a report as text."""
    size = " x ".join(f"{length:.4g}" for length in report["size"])
    rows = [
        ("mesh", f"{report['vertices']} vertices, {report['triangles']} triangles"),
        ("size", f"{size} m"),
        ("area", f"{report['area']:.6g} m^2"),
        ("volume", f"{report['volume']:.6g} m^3"),
    ]
    rows += [("note", note) for note in report["notes"]]
    rows.append(("atlas", charts_text(report["charts"], report["method"])))
    for name, value in report["quality"].items():
        label, unit = _FIGURES[name]
        rows.append((label, f"{value:.6g} {unit}".rstrip()))
    for name, thickness in report.get("thickness", {}).items():
        rows.append((f"thickness, {name}", f"{thickness:.6g} m"))
    for stage, seconds in report["seconds"].items():
        rows.append((f"{stage.replace('_', ' ')} time", f"{seconds:.3f} s"))
    width = max(len(label) for label, _ in rows)
    lines = [f"{label:<{width}}  {value}" for label, value in rows]
    return "\n".join([report["mesh"], *lines])


@dataclasses.dataclass(frozen=True, kw_only=True)
class ModesCommand:
    """Find the modes of a mesh: the frequencies and shapes in which it rings, and their decay."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...), in metres."""
    material: NamedMaterial
    """A preset from `ripple-sim materials`, or membrane, layer, jelly, plate or water. Parameters
    may follow, as in steel-plate,thickness=0.002."""
    count: Annotated[Count, arg(aliases=["-n"])] = 20
    """Number of modes, from the lowest frequency up."""
    resolution: Count = 64
    """Texels along the edge of a cube's chart, N. Every layout has about 6 N^2 texels in all."""
    layout: LayoutName = "auto"
    """Layout of the charts: cube (for a closed mesh in one part without handles), patches (any
    mesh), or auto, which takes the cube for round bodies."""
    rim: RimName = "free"
    """Rim of an open mesh: free, fixed (a drum's skin), supported or clamped (a plate)."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write an image that shows every mode."""
    up: UpAxis = None
    """Axis of the mesh that points up in the image."""
    json: bool = False
    """Print JSON."""
    overwrite: bool = False
    """Replace files that ripple-sim has not made. The mesh itself is never replaced."""

    def run(self) -> None:
        """Find the modes, plot them if requested, and print a table."""
        from ripple_sim.scene.material_entry import preset_material
        from ripple_sim.solver import build_atlas, load_mesh, modes
        from ripple_sim.solver.mesh.files import check_mesh_file

        check_mesh_file(self.mesh)
        if self.plot is not None:
            from ripple_sim.figures.figure_file import check_plot_path

            _check_other(self.plot, self.mesh, "the mesh")
            check_plot_path(self.plot, self.overwrite)
        material = preset_material(*self.material)
        atlas = build_atlas(load_mesh(self.mesh), resolution=self.resolution, layout=self.layout)
        spectrum = modes(atlas, material, self.count, rim=self.rim)
        if self.plot is not None:
            self._plot(self.plot, atlas, spectrum)
        lowest = spectrum.frequencies[0]
        report = [  # as JSON can hold them, in [Hz] and [s]
            {
                "frequency": float(frequency),
                "ratio": float(frequency / lowest) if lowest else None,
                "decay_time": float(decay) if np.isfinite(decay) else None,
            }
            for frequency, decay in zip(spectrum.frequencies, spectrum.decay_times, strict=True)
        ]
        if self.json:
            print(json_format.dumps(report, indent=2))
            return
        print("mode  frequency [Hz]   ratio  falls to 1/e in [s]")
        for number, mode in enumerate(report, 1):
            ratio = _number_or_dash(mode["ratio"])
            decay_time = _number_or_dash(mode["decay_time"])
            print(f"{number:4}  {mode['frequency']:14.5g}  {ratio:>6}  {decay_time}")

    def _plot(self, path: Path, atlas: Atlas, spectrum: Modes) -> None:
        from ripple_sim.figures.mode_plot import plot_modes
        from ripple_sim.scene.standing import usual_up

        size = " x ".join(f"{metres:.3g}" for metres in np.ptp(atlas.mesh.V, axis=0))
        rim = "" if atlas.mesh.closed else f", {self.rim} rim"
        subtitle = f"{self.material[0]}, {size} m{rim}; red is outwards, blue is inwards"
        up = self.up or usual_up(self.mesh)
        title = f"Modes of {self.mesh.stem}"
        plot_modes(atlas, spectrum, path, title=title, subtitle=subtitle, up=up)


def _number_or_dash(value: float | None) -> str:
    """A number with four digits; a dash for None."""
    return "-" if value is None else f"{value:.4g}"
