"""All measurements in one run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ripple_sim.info import Info, collect
from ripple_sim.solver import load_mesh

from .accuracy import energy_drift, sphere_modes
from .arrival_table import arrivals
from .coupling import coupling_cost
from .report_text import as_text
from .speed import cpu_speed, gl_speed
from .table import steps_per_second

__all__ = ["Report", "as_text", "measure"]

Report = dict[str, Any]


def measure(meshes: list[Path], say: Callable[[str], object] = lambda stage: None) -> Report:
    """Measure everything; `say` is called with the name of each stage as it begins.

    Raises
    ------
    MeshError
        Before anything is measured, if a mesh cannot be read.
    """
    loaded = {path.stem: load_mesh(path) for path in meshes}
    report: Report = {"machine": _machine(collect())}
    stages: dict[str, Callable[[], Any]] = {
        "cpu": lambda: {str(n): cpu_speed(n) for n in (256, 512)},
        "gl": lambda: {str(n): gl_speed(n) for n in (256, 512)},
        "table": steps_per_second,
        "coupling": coupling_cost,
        "sphere": sphere_modes,
        "energy": energy_drift,
        "arrival": lambda: arrivals(loaded),
    }
    for name, run in stages.items():
        say(name)
        report[name] = run()
    return report


def _machine(info: Info) -> dict[str, Any]:
    return {
        "version": info.versions["ripple-sim"],
        "system": info.system,
        "processors": info.processors,
        "renderer": info.opengl.renderer if info.opengl else "no OpenGL",
        "software": info.opengl.software if info.opengl else None,
    }
