"""The report of `ripple-sim atlas`: the mesh, what was done to it, the quality of the atlas, the time of each stage."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

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

    Parameters
    ----------
    path : path
        The mesh's file.
    atlas : Atlas
    method : str
        Its sphere map; counts for the cube layout only.
    seconds : dict
        Wall time of each stage [s].
    thickness : [C, n, n], optional
        Of the layer over what is inside [m].

    Returns
    -------
    dict
        `mesh`, `vertices`, `triangles`, `size` of the bounding box [m], `area` [m^2], `volume` [m^3], `notes` (what was
        done to it, one line each), `layout`, `method`, `charts` (C, n, n), `resolution` n, `quality` (see
        `Atlas.quality`), `thickness` if it is given (quantiles by texels [m]) and `seconds`.
    """
    mesh = atlas.mesh
    known = {} if thickness is None else {"thickness": _quantiles(thickness)}
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


def _quantiles(thickness: NDArray[np.float64]) -> dict[str, float]:
    names, shares = ("least", "q01", "median", "q99", "greatest"), (0, 0.01, 0.5, 0.99, 1)
    return dict(zip(names, np.quantile(thickness, shares).tolist(), strict=True))


def charts_text(shape: Sequence[int], method: str | None) -> str:
    """Number and size of charts of a shape (C, n, n), and the sphere map that the cube layout has, as text."""
    return f"{' x '.join(map(str, shape))} texels, {'patches' if method is None else f'{method} sphere map'}"


def _figure(name: str, value: float) -> tuple[str, str]:
    label, unit = _FIGURES[name]
    return label, f"{value:.6g} {unit}".rstrip()


def report_text(report: dict[str, Any]) -> str:
    """Format a report as text."""
    rows = [
        ("mesh", f"{report['vertices']} vertices, {report['triangles']} triangles"),
        ("size", f"{' x '.join(f'{x:.4g}' for x in report['size'])} m"),
        ("area", f"{report['area']:.6g} m^2"),
        ("volume", f"{report['volume']:.6g} m^3"),
        *(("note", note) for note in report["notes"]),
        ("atlas", charts_text(report["charts"], report["method"])),
        *(_figure(name, value) for name, value in report["quality"].items()),
        *((f"thickness, {name}", f"{metres:.6g} m") for name, metres in report.get("thickness", {}).items()),
        *((f"{stage.replace('_', ' ')} time", f"{seconds:.3f} s") for stage, seconds in report["seconds"].items()),
    ]
    width = max(len(name) for name, _ in rows)
    return "\n".join([report["mesh"], *(f"{name:<{width}}  {value}" for name, value in rows)])
