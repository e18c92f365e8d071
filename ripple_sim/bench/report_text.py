"""How a report of `measure` reads as text: a title and a table for each measurement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .coupling import BODIES
from .table import RESOLUTIONS


def as_text(report: Mapping[str, Any]) -> str:
    """Lay a report out for reading."""
    machine = report["machine"]
    gl = {n: row for n, row in report["gl"].items() if row is not None}
    blocks = [
        f"{machine['processors']} processors, {machine['renderer']}\nripple-sim {machine['version']}",
        _naive(report["cpu"]),
        _bounds(report["cpu"]),
        *([_gl(gl)] if gl else []),
        _steps(report["table"]),
        _coupling(report["coupling"]),
        _sphere(report["sphere"]),
        _title("Energy without damping, float32")
        + "over {steps:,} steps: largest relative change {largest:.1e}, trend {trend:+.1e}".format(**report["energy"]),
        _arrival(report["arrival"]),
    ]
    return "\n\n".join(blocks)


def _naive(table: Mapping[str, Mapping[str, float]]) -> str:
    head = ["N", "over naive loop", "one thread each", "all threads each", "ripple-sim", "its threads", "naive loop"]
    rows = [
        [
            n,
            *(_ratio(row[key]) for key in ("over naive", "one thread over naive", "all threads over naive")),
            *(_millions(row["cpu"]), str(row["threads"])),
            f"{_millions(row['naive'])} ({'prange' if row['naive'] > row['naive 1'] else 'one thread'})",
        ]
        for n, row in table.items()
    ]
    return _title(
        "CPU against the same stencil as a plain numba loop, in one thread or in all (prange), whichever is faster:\n"
        "ratios, and texel updates a second in millions"
    ) + _grid(head, rows)


def _bounds(table: Mapping[str, Mapping[str, float]]) -> str:
    head = ["N", "of memory bound", "memory bound", "one thread of it", "ripple-sim, one thread", "scipy", "over scipy"]
    rows = [
        [
            n,
            *(_ratio(row["of stream"]), _millions(row["stream"]), _ratio(row["one thread of stream"])),
            *(_millions(row["cpu 1"]), _millions(row["scipy"]), _ratio(row["one thread over scipy"])),
        ]
        for n, row in table.items()
    ]
    return _title(
        "CPU against the memory bound (28 bytes read and 8 written a texel, in as many threads),\n"
        "and in one thread against scipy's sparse matrix, which has one thread"
    ) + _grid(head, rows)


def _gl(table: Mapping[str, Mapping[str, float]]) -> str:
    rows = [[n, _ratio(row["over plain"]), _millions(row["gl"]), _millions(row["plain"])] for n, row in table.items()]
    return _title("OpenGL: texel updates a second, in millions") + _grid(
        ["N", "over plain shader", "ripple-sim", "plain shader"], rows
    )


def _steps(table: Mapping[str, Mapping[str, float]]) -> str:
    finest = RESOLUTIONS[-1]
    rows = [
        [
            count,
            *(f"{row[f'steps/s {n}']:,.0f}" for n in RESOLUTIONS),
            f"{row['sphere map [s]']:.2f} s",
            f"{row[f'atlas {finest} [s]']:.2f} s",
        ]
        for count, row in table.items()
    ]
    return _title("Steps a second over resolution and polygon count (the paper's table 1), CPU") + _grid(
        ["polygons", *(f"N = {n}" for n in RESOLUTIONS), "sphere map", f"atlas N = {finest}"], rows
    )


def _coupling(table: Mapping[str, Mapping[str, float]]) -> str:
    rows = [
        [
            name,
            f"{row['touching']:.1f}",
            *(f"{1e3 * row[key]:.3f}" for key in ("mj_step [s]", "coupling [s]", "waves [s]")),
            _ratio(row["of mj_step"]),
        ]
        for name, row in table.items()
    ]
    return _title(f"Coupling: {BODIES} bodies rain on a target that collides as its true surface, ms a step") + _grid(
        ["target", "touching", "mj_step", "coupling", "waves", "coupling over mj_step"], rows
    )


def _sphere(table: Mapping[str, Mapping[str, float]]) -> str:
    columns = list(table["fem"])
    rows = [[name, *(f"{row[key]:.3g}" if key in row else "" for key in columns)] for name, row in table.items()]
    return _title("Unit sphere, mode Y40 after one period: relative L2 error, and order by regression") + _grid(
        ["operator", *(key if key == "order" else f"N = {key}" for key in columns)], rows
    )


def _arrival(table: Mapping[str, Mapping[str, Mapping[str, float] | None]]) -> str:
    head = ["mesh", "operator", "front: median", "90 %", "under 3 %", "crest: median", "90 %", "under 3 %", "speed"]
    rows = []
    for mesh, operators in table.items():
        for operator, row in operators.items():
            if row is None:
                rows.append([mesh, operator, "refused: no sphere map without folds", *[""] * 6])
                continue
            errors = [f"{100 * value:.2f} %" for key, value in row.items() if key != "speed factor"]
            rows.append([mesh, operator, *errors, f"x {row['speed factor']:.3f}" if "speed factor" in row else ""])
    return _title("Time of arrival against exact geodesics, N = 96: relative error") + _grid(head, rows)


def _title(text: str) -> str:
    return f"{text}\n"


def _millions(rate: float) -> str:
    return f"{rate / 1e6:,.0f}"


def _ratio(value: float) -> str:
    return f"{value:.2f}"


def _grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Align columns: the first to the left, the others to the right."""
    widths = [max(len(line[i]) for line in [head, *rows]) for i in range(len(head))]
    lines = [
        "  ".join(
            cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(line, widths, strict=True))
        )
        for line in [head, *rows]
    ]
    return "\n".join(line.rstrip() for line in lines)
