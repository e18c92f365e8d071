"""All measurements in one run, and how they read as text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ripple_sim.diagnostics.info import Info, collect

from .accuracy import arrivals, energy_drift, sphere_modes
from .coupling import BODIES, coupling_cost
from .speed import cpu_speed, gl_speed
from .table import RESOLUTIONS, steps_per_second

Report = dict[str, Any]


def measure(meshes: list[Path], say: Any = lambda stage: None) -> Report:
    """Measure everything; `say` is called with the name of each stage as it begins."""
    report: Report = {"machine": _machine(collect())}
    stages = {
        "cpu": lambda: {str(n): cpu_speed(n) for n in (256, 512)},
        "gl": lambda: {str(n): gl_speed(n) for n in (256, 512)},
        "table": steps_per_second,
        "coupling": coupling_cost,
        "sphere": sphere_modes,
        "energy": energy_drift,
        "arrival": lambda: arrivals(meshes),
    }
    for name, run in stages.items():
        say(name)
        report[name] = run()
    return report


def as_text(report: Report) -> str:
    """Lay a report out for reading."""
    machine = report["machine"]
    blocks = [
        f"{machine['processors']} processors, {machine['renderer']}\nripple-sim {machine['version']}",
        _title("CPU: texel updates a second, in millions, and ratios; the copy and scipy have one thread")
        + _grid(
            [
                *("N", "ripple-sim", "in one thread", "copy of as many bytes", "scipy"),
                *("over scipy", "one thread over scipy", "one thread of the copy"),
            ],
            [
                [
                    n,
                    *(_millions(row[key]) for key in ("cpu", "one thread", "copy", "scipy")),
                    *(_ratio(row[key]) for key in ("over scipy", "one thread over scipy", "of copy")),
                ]
                for n, row in report["cpu"].items()
            ],
        ),
    ]
    gl = {n: row for n, row in report["gl"].items() if row is not None}
    if gl:
        blocks.append(
            _title("OpenGL: texel updates a second, in millions, and ratio")
            + _grid(
                ["N", "ripple-sim", "plain shader", "over plain"],
                [
                    [n, _millions(row["gl"]), _millions(row["plain"]), _ratio(row["over plain"])]
                    for n, row in gl.items()
                ],
            )
        )
    blocks += [
        _title("Steps a second over resolution and polygon count (the paper's table 1), CPU")
        + _grid(
            ["polygons", *(f"N = {n}" for n in RESOLUTIONS), "sphere map", f"atlas N = {RESOLUTIONS[-1]}"],
            [
                [
                    count,
                    *(f"{row[f'steps/s {n}']:,.0f}" for n in RESOLUTIONS),
                    f"{row['sphere map [s]']:.2f} s",
                    f"{row[f'atlas {RESOLUTIONS[-1]} [s]']:.2f} s",
                ]
                for count, row in report["table"].items()
            ],
        ),
        _title(f"Coupling: {BODIES} bodies rain on a target that collides as its true surface, ms a step")
        + _grid(
            ["target", "touching", "mj_step", "coupling", "waves", "coupling over mj_step"],
            [
                [
                    name,
                    f"{row['touching']:.1f}",
                    *(f"{1e3 * row[key]:.3f}" for key in ("mj_step [s]", "coupling [s]", "waves [s]")),
                    _ratio(row["of mj_step"]),
                ]
                for name, row in report["coupling"].items()
            ],
        ),
        _title("Unit sphere, mode Y40 after one period: relative L2 error, and order by regression")
        + _sphere(report["sphere"]),
        _title("Energy without damping, float32")
        + "over {steps:,} steps: largest relative change {largest:.1e}, trend {trend:+.1e}".format(**report["energy"]),
        _title("Time of arrival against exact geodesics, N = 96: relative error")
        + _grid(
            ["mesh", "operator", "front: median", "90 %", "under 3 %", "crest: median", "90 %", "under 3 %"],
            [
                [mesh, operator, *(f"{100 * value:.2f} %" for value in error.values())]
                for mesh, table in report["arrival"].items()
                for operator, error in table.items()
            ],
        ),
    ]
    return "\n\n".join(blocks)


def _machine(info: Info) -> dict[str, Any]:
    return {
        "version": info.versions["ripple-sim"],
        "system": info.system,
        "processors": info.processors,
        "renderer": info.opengl.renderer if info.opengl else "no OpenGL",
        "software": info.opengl.software if info.opengl else None,
    }


def _sphere(table: dict[str, dict[str, float]]) -> str:
    columns = list(table["fem"])
    rows = [[name, *(f"{row[key]:.3g}" if key in row else "" for key in columns)] for name, row in table.items()]
    return _grid(["operator", *(key if key == "order" else f"N = {key}" for key in columns)], rows)


def _title(text: str) -> str:
    return f"{text}\n"


def _millions(rate: float) -> str:
    return f"{rate / 1e6:,.0f}"


def _ratio(value: float) -> str:
    return f"{value:.2f}"


def _grid(head: list[str], rows: list[list[str]]) -> str:
    widths = [max(len(line[i]) for line in [head, *rows]) for i in range(len(head))]
    lines = [
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in [head, *rows]
    ]
    return "\n".join(line.rstrip() for line in lines)
