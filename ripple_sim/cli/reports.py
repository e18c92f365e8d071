"""Commands that print a report, `atlas`, `bench`, `cache`, `info` and `materials`, and `batch`, which ends with one.

That of an atlas tells of the mesh, what was done to it, the quality of the atlas, and the time of each stage. A batch
shows how far it is by a bar on a terminal, and by a line a minute in a log.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json as json_format
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress as Bars, TextColumn
from tyro.conf import Positional, arg

from .arguments import Count, Gigabytes, LayoutName, Limit, Shard, UpAxis

if TYPE_CHECKING:
    from ripple_sim.batch.plan import Plan
    from ripple_sim.batch.run import Progress
    from ripple_sim.solver import Atlas


@dataclasses.dataclass(frozen=True, kw_only=True)
class AtlasCommand:
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
            from ripple_sim.figures.atlas_plot import check_plot_path

            check_plot_path(self.plot, self.overwrite)

    def _plot(self, path: Path, atlas: Atlas, thickness: NDArray[np.float64] | None) -> None:
        from ripple_sim.figures.atlas_plot import plot_atlas, plot_thickness
        from ripple_sim.scene.drop import usual_up

        mesh, up = atlas.mesh, self.up or usual_up(self.mesh)
        method = self.method if atlas.layout == "cube" else None
        subtitle = f"{len(mesh.V):,} vertices, {len(mesh.F):,} triangles; {charts_text(atlas.texels.shape, method)}"
        if thickness is None:
            plot_atlas(atlas, path, title=self.mesh.stem, subtitle=subtitle, up=up)
        else:
            subtitle = f"thickness over {self.inside.name if self.inside else ''}; {subtitle}"
            plot_thickness(atlas, thickness, path, title=self.mesh.stem, subtitle=subtitle, up=up)


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


def atlas_report(
    path: Path, atlas: Atlas, method: str, seconds: dict[str, float], thickness: NDArray[np.float64] | None = None
) -> dict[str, Any]:
    """Figures of an atlas, as JSON can hold them.

    They are of the mesh in the file at a path (`size` of the bounding box [m], `area` [m^2], `volume` [m^3], `notes` on
    what was done to it), of its charts (C, n, n), the `method` of the cube's sphere map, `quality` (see
    `Atlas.quality`), quantiles of the `thickness` [m] of a layer, and wall time of each stage [s].
    """
    mesh = atlas.mesh
    known: dict[str, Any] = {}
    if thickness is not None:
        names, shares = ("least", "q01", "median", "q99", "greatest"), (0, 0.01, 0.5, 0.99, 1)
        known = {"thickness": dict(zip(names, np.quantile(thickness, shares).tolist(), strict=True))}
    return {
        "mesh": str(path),
        "vertices": len(mesh.V),
        "triangles": len(mesh.F),
        "size": np.ptp(mesh.V, axis=0).tolist(),
        "area": mesh.area,
        "volume": mesh.volume,
        "notes": list(mesh.notes),
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
    return f"{' x '.join(map(str, shape))} texels, {'patches' if method is None else f'{method} sphere map'}"


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
        *((f"thickness, {name}", f"{metres:.6g} m") for name, metres in report.get("thickness", {}).items()),
        *((f"{stage.replace('_', ' ')} time", f"{seconds:.3f} s") for stage, seconds in report["seconds"].items()),
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join([report["mesh"], *(f"{name:<{width}}  {value}" for name, value in rows)])


@dataclasses.dataclass(frozen=True, kw_only=True)
class BenchCommand:
    """Measure the wave solver: speed beside the bound of memory, cost of the coupling, accuracy against theory."""

    meshes: Annotated[Positional[tuple[Path, ...]], arg(metavar="[MESH ...]", help_behavior_hint="(optional)")] = ()
    """Meshes of which to time the atlas and the wave step, in addition to the duck."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Measure and print; the stages are announced on stderr."""
        from ripple_sim.bench import as_text, measure

        report = measure(list(self.meshes), lambda stage: print(f"measuring {stage} ...", file=sys.stderr))
        print(json_format.dumps(report, indent=2) if self.json else as_text(report))


@dataclasses.dataclass(frozen=True, kw_only=True)
class CacheCommand:
    """Show where atlases are kept, and how much room they take: at most RIPPLE_SIM_CACHE_LIMIT megabytes, or 500."""

    clear: bool = False
    """Remove them."""

    def run(self) -> None:
        """Clear the cache if asked to, and print what is in it."""
        from ripple_sim.solver.cache import cache_folder, cache_limit, cached_files, remove

        limit, files = cache_limit(), cached_files()
        if self.clear:
            freed = sum(remove(file) for file in files)
            print(f"removed {len(files)} files, {freed / 1e6:.0f} MB")
            files = cached_files()
        size = sum(file.size for file in files)
        print(f"{cache_folder()}: {len(files)} files, {size / 1e6:.0f} of {limit / 1e6:.0f} MB")


@dataclasses.dataclass(frozen=True, kw_only=True)
class InfoCommand:
    """Show versions, the OpenGL driver and the wave solver, and what to install if rendering is not possible."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the report."""
        from ripple_sim.diagnostics import as_text, collect

        info = collect()
        print(json_format.dumps(info, indent=2) if self.json else as_text(info))


# Of the wave whose speed and decay are told [m].
_WAVELENGTH = 0.05


@dataclasses.dataclass(frozen=True, kw_only=True)
class MaterialsCommand:
    """List the real materials by name, with speed and decay of a wave of 5 cm, sources, and where they hold."""

    json: bool = False
    """Print them as JSON."""

    def run(self) -> None:
        """Print the table."""
        from ripple_sim.solver import Material
        from ripple_sim.solver.operator.material import decay_time, phase_speed
        from ripple_sim.solver.operator.presets import PRESETS

        q, table = 2 * math.pi / _WAVELENGTH, {}
        for name, preset in PRESETS.items():
            material = Material.preset(name)
            facts = {"speed [m/s]": phase_speed(material, q), "decay [s]": decay_time(material, q)}
            table[name] = facts | dataclasses.asdict(preset)
        if self.json:
            print(json_format.dumps(table, indent=2))
            return
        width = max(map(len, table))
        for name, row in table.items():
            print(f"{name:{width}}  {row['speed [m/s]']:.3g} m/s, falls to 1/e in {row['decay [s]']:.3g} s")
            parameters = ", ".join(f"{key} {value:g}" for key, value in row["parameters"].items())
            print(f"{'':{width}}  {row['law']}: {parameters}")
            print(f"{'':{width}}  holds: {row['valid']}")
            print(f"{'':{width}}  source{'' if row['checked'] else ', not checked'}: {row['source']}")


@dataclasses.dataclass(frozen=True, kw_only=True)
class BatchCommand:
    """Make many scenes by one plan, each varied by its own seed."""

    plan: Annotated[Positional[Path], arg(metavar="PLAN|DIR")]
    """The plan (TOML), or the folder of a batch to go on with."""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="DIR", help_behavior_hint="(needed with a plan)")] = None
    """Folder of the batch. Run again, it makes what is not there yet."""
    workers: Limit = None
    """Processes that make scenes; by default one for every two cores, at least two."""
    shard: Shard = None
    """Make a part of the scenes only, for several machines."""
    dask: Annotated[str | None, arg(metavar="ADDRESS", help_behavior_hint="(optional)")] = None
    """Address of a Dask scheduler whose workers make the scenes (needs Dask); they share the folder."""
    limit: Limit = None
    """Make at most so many scenes in this run."""
    keep_free: Gigabytes = 1.0
    """Stop when the disk has no more room than this."""
    status: bool = False
    """Tell how far the batch is, and make nothing."""
    retry_failed: bool = False
    """Try the scenes again that were put aside."""
    dry_run: bool = False
    """Make one scene for a trial, and tell the first scenes' values, the time and the room that all will take."""

    def run(self) -> None:
        """Do what is asked for."""
        from ripple_sim.batch.report import parquet

        plan, folder = self._plan_and_folder()
        parquet()  # before anything that takes time
        if self.status:
            from ripple_sim.batch.report import status_text

            print(status_text(folder))
        elif self.dry_run:
            from ripple_sim.batch.run import trial_text

            print(trial_text(plan, folder, self.workers))
        else:
            self._make(plan, folder)

    def _plan_and_folder(self) -> tuple[Plan | None, Path]:
        from ripple_sim.errors import BatchError

        if self.plan.is_dir():
            if self.output is not None:
                raise BatchError(f"{self.plan} is the folder of a batch: leave -o out, or name a plan")
            return None, self.plan
        from ripple_sim.batch.plan import read_plan

        plan = read_plan(self.plan)
        if self.output is None and not self.dry_run:
            raise BatchError("a plan needs a folder for its scenes: add -o DIR")
        return plan, self.output or self.plan.with_suffix("")

    def _make(self, plan: Plan | None, folder: Path) -> None:
        from ripple_sim.batch.report import status_text
        from ripple_sim.batch.run import RunOptions, run_batch

        options = RunOptions(
            workers=self.workers,
            shard=self.shard or (1, 1),
            limit=self.limit,
            dask=self.dask,
            retry_failed=self.retry_failed,
            keep_free=self.keep_free * 1e9,
        )
        with batch_progress() as progress:
            run_batch(plan, folder, options, progress=progress)
        print(status_text(folder))


_BETWEEN = 60.0  # lines in a log [s]


def progress_text(progress: Progress) -> str:
    """Frames, rate, time left, failures, room taken and left on the disk, in a line."""
    left = progress.scenes - progress.finished - progress.aside
    parts = [f"{progress.frames} frames"]
    if progress.made and progress.seconds:
        rate = progress.made / progress.seconds
        parts += [f"{3600 * rate:.0f} scenes/h", f"{duration_text(left / rate)} left"]
    if progress.failures or progress.aside:
        parts.append(f"{progress.failures} failed, {progress.aside} put aside")
    return ", ".join([*parts, f"{progress.bytes / 1e9:.2f} GB written", f"{progress.free / 1e9:.1f} GB free"])


def duration_text(seconds: float) -> str:
    """A time in seconds, minutes and hours."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextlib.contextmanager
def batch_progress() -> Iterator[Callable[[Progress], None]]:
    """Yield a function that shows a batch's progress on stderr."""
    if not sys.stderr.isatty():
        told = time.monotonic()

        def log(progress: Progress) -> None:
            nonlocal told
            if time.monotonic() - told >= _BETWEEN:
                told = time.monotonic()
                done = progress.finished + progress.aside
                print(f"{done} of {progress.scenes} scenes, {progress_text(progress)}", file=sys.stderr, flush=True)

        yield log
        return
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("scenes, {task.description}"))
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=None)
        yield lambda now: bars.update(
            task, total=now.scenes, completed=now.finished + now.aside, description=progress_text(now)
        )
