"""Commands on a mesh: `atlas`, which reports what its charts are like, and `modes`, how it rings.

The report of an atlas tells of the mesh, what was done to it, the quality of the atlas, and the
time of each stage.
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

# By figure of `Atlas.quality`: what it is called in the text, and its unit.
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
    """Texels along the edge of a cube's chart, N: about 6 N^2 in all, in every layout."""
    layout: LayoutName = "auto"
    """Cube (closed, in one part, without handles), patches (any mesh), or auto: cube for round bodies."""
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

        self._check()
        inside = None
        if self.inside is not None:
            from ripple_sim.scene.target_maps import load_inside

            inside = load_inside(self.inside, self.threshold, self.spacing)
        start = time.perf_counter()
        mesh = load_mesh(self.mesh, repair=self.repair, wrap=self.wrap)
        loaded = time.perf_counter()
        atlas = build_atlas(
            mesh, resolution=self.resolution, method=self.method, layout=self.layout
        )
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
            from ripple_sim.figures.atlas_plot import check_plot_path

            check_plot_path(self.plot, self.overwrite)

    def _plot(self, path: Path, atlas: Atlas, thickness: NDArray[np.float64] | None) -> None:
        from ripple_sim.figures.atlas_plot import plot_atlas, plot_thickness
        from ripple_sim.scene.drop import usual_up

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


def _check_other(path: Path, read: Path | None, what: str) -> None:
    """Refuse to write over a file that is read."""
    from ripple_sim.solver import AtlasError

    if read is not None and path.exists() and read.exists() and path.samefile(read):
        raise AtlasError(f"cannot write {path}: it is {what} itself; name another file")


def atlas_report(
    path: Path,
    atlas: Atlas,
    method: str,
    seconds: dict[str, float],
    thickness: NDArray[np.float64] | None = None,
) -> dict[str, Any]:
    """Figures of an atlas, as JSON can hold them.

    They are of the mesh in the file at a path (`size` of the bounding box [m], `area` [m^2],
    `volume` [m^3], `notes` on what was done to it and why it got its layout), of its charts (C, n,
    n), the `method` of the cube's sphere map, `quality` (see `Atlas.quality`), quantiles of the
    `thickness` [m] of a layer, and wall time of each stage [s].
    """
    mesh = atlas.mesh
    known: dict[str, Any] = {}
    if thickness is not None:
        names = ("least", "q01", "median", "q99", "greatest")
        shares = (0, 0.01, 0.5, 0.99, 1)
        known = {
            "thickness": dict(zip(names, np.quantile(thickness, shares).tolist(), strict=True))
        }
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
        **known,
        "seconds": seconds,
    }


def charts_text(shape: Sequence[int], method: str | None) -> str:
    """Number and size of charts of a shape (C, n, n), and the sphere map that the cube layout has, as text."""
    return (
        f"{' x '.join(map(str, shape))} texels, "
        f"{'patches' if method is None else f'{method} sphere map'}"
    )


def report_text(report: dict[str, Any]) -> str:
    """Format a report as text."""
    rows = [
        ("mesh", f"{report['vertices']} vertices, {report['triangles']} triangles"),
        ("size", f"{' x '.join(f'{x:.4g}' for x in report['size'])} m"),
        ("area", f"{report['area']:.6g} m^2"),
        ("volume", f"{report['volume']:.6g} m^3"),
        *(("note", note) for note in report["notes"]),
        ("atlas", charts_text(report["charts"], report["method"])),
        *(
            (_FIGURES[name][0], f"{value:.6g} {_FIGURES[name][1]}".rstrip())
            for name, value in report["quality"].items()
        ),
        *(
            (f"thickness, {name}", f"{metres:.6g} m")
            for name, metres in report.get("thickness", {}).items()
        ),
        *(
            (f"{stage.replace('_', ' ')} time", f"{seconds:.3f} s")
            for stage, seconds in report["seconds"].items()
        ),
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join([report["mesh"], *(f"{name:<{width}}  {value}" for name, value in rows)])


@dataclasses.dataclass(frozen=True, kw_only=True)
class ModesCommand:
    """Find the modes of a mesh: at which frequencies it rings, in which shapes, and how fast they die."""

    mesh: Annotated[Positional[Path], arg(metavar="MESH")]
    """Mesh file (OBJ, OFF, PLY, STL, GLB ...), in metres."""
    material: NamedMaterial
    """One of ripple-sim materials, or membrane, layer, jelly, plate or water; with parameters of its own if they
    follow, such as steel-plate,thickness=0.002."""
    count: Annotated[Count, arg(aliases=["-n"])] = 20
    """How many, from the lowest on."""
    resolution: Count = 64
    """Texels along the edge of a cube's chart, N: about 6 N^2 in all, in every layout."""
    layout: LayoutName = "auto"
    """Cube (closed, in one part, without handles), patches (any mesh), or auto: cube for round bodies."""
    rim: RimName = "free"
    """Rim of an open mesh: free, fixed as that of a drum, or supported or clamped as that of a plate."""
    plot: Annotated[Path | None, arg(metavar="PNG", help_behavior_hint="(optional)")] = None
    """Write an image with a picture of each mode."""
    up: UpAxis = None
    """Axis of the mesh that points up in the image."""
    json: bool = False
    """Print JSON."""
    overwrite: bool = False
    """Replace files that ripple-sim has not made; the mesh itself never."""

    def run(self) -> None:
        """Find the modes, plot them if asked to, and print a table."""
        from ripple_sim.scene.material_entry import preset_material
        from ripple_sim.solver import build_atlas, load_mesh, modes
        from ripple_sim.solver.mesh.files import check_mesh_file

        check_mesh_file(self.mesh)
        if self.plot is not None:
            from ripple_sim.figures.atlas_plot import check_plot_path

            _check_other(self.plot, self.mesh, "the mesh")
            check_plot_path(self.plot, self.overwrite)
        material = preset_material(*self.material)
        atlas = build_atlas(load_mesh(self.mesh), resolution=self.resolution, layout=self.layout)
        found = modes(atlas, material, self.count, rim=self.rim)
        if self.plot is not None:
            self._plot(self.plot, atlas, found)
        first = found.frequencies[0]
        report = [  # as JSON can hold them, in [Hz] and [s]
            {
                "frequency": float(frequency),
                "ratio": float(frequency / first) if first else None,
                "decay_time": float(decay) if np.isfinite(decay) else None,
            }
            for frequency, decay in zip(found.frequencies, found.decay_times, strict=True)
        ]
        if self.json:
            print(json_format.dumps(report, indent=2))
            return
        print("mode  frequency [Hz]   ratio  falls to 1/e in [s]")
        for number, mode in enumerate(report, 1):
            ratio, last = (
                "-" if mode[key] is None else f"{mode[key]:.4g}" for key in ("ratio", "decay_time")
            )
            print(f"{number:4}  {mode['frequency']:14.5g}  {ratio:>6}  {last}")

    def _plot(self, path: Path, atlas: Atlas, found: Modes) -> None:
        from ripple_sim.figures.mode_plot import plot_modes
        from ripple_sim.scene.drop import usual_up

        size = " x ".join(f"{metres:.3g}" for metres in np.ptp(atlas.mesh.V, axis=0))
        rim = "" if atlas.mesh.closed else f", {self.rim} rim"
        subtitle = f"{self.material[0]}, {size} m{rim}; red is outwards, blue is inwards"
        up = self.up or usual_up(self.mesh)
        plot_modes(atlas, found, path, title=f"Modes of {self.mesh.stem}", subtitle=subtitle, up=up)
