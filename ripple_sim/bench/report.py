"""All measurements in one run.

How exact the operators are, where theory is exact: a mode of the sphere, and energy.

The shape of the paper's table 1: steps a second over resolution and polygon count.

How a report of `measure` reads as text: a title and a table for each measurement.

How fast the backends are, against rivals that take turns with them, so that a busy machine slows all alike.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ripple_sim.diagnostics import Info, collect
from ripple_sim.solver import GLError, Material, Mesh, WaveSolver, build_atlas, load_mesh, sphere_atlas
from ripple_sim.solver.backends.backend import Backend, make_backend
from ripple_sim.solver.backends.cpu import CPUBackend
from ripple_sim.solver.layouts.build import atlas_from_sphere_map
from ripple_sim.solver.operator.assembly import OPERATORS, build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator

from .arrival import arrivals
from .coupling import BODIES, coupling_cost
from .rivals import MemoryStream, NaiveLoop, PlainShader, SparseLeapfrog

__all__ = ["Report", "as_text", "measure"]


def sphere_mode_error(resolution: int, operator: str = "fem") -> float:
    """Relative L2 error of the unit sphere's mode Y_40 after one period, at 1 m/s."""
    atlas = sphere_atlas(1.0, resolution)
    waves = WaveSolver(atlas, backend="cpu", operator=operator)
    z = atlas.positions[..., 2]
    mode = (35 * z**4 - 30 * z**2 + 3) / 8
    waves.height = mode
    waves.step(2 * np.pi / np.sqrt(20))
    return float(np.sqrt((atlas.areas * (waves.height - mode) ** 2).sum() / (atlas.areas * mode**2).sum()))


def sphere_modes(resolutions: tuple[int, ...] = (16, 32, 64, 128, 256)) -> dict[str, dict[str, float]]:
    """Errors of all operators over the resolution, and their order by regression."""
    table = {}
    for operator in OPERATORS:
        sizes = resolutions if operator == "fem" else tuple(n for n in resolutions if n <= 64)
        errors = [sphere_mode_error(n, operator) for n in sizes]
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        table[operator] = {**{str(n): e for n, e in zip(sizes, errors, strict=True)}, "order": float(order)}
    return table


def energy_drift(resolution: int = 64, steps: int = 10_000) -> dict[str, float]:
    """Largest relative change of the energy over a number of steps in float32, and its trend over all of them."""
    atlas = sphere_atlas(1.0, resolution)
    waves = WaveSolver(atlas, backend="cpu")
    waves.add_impulse([0.3, -0.5, 0.8], 1.0, 0.3)
    dt = waves.stable_timestep
    waves.step(10 * dt)
    momentum = waves.momentum()
    energies = [waves.energy()]
    for _ in range(100):
        waves.step(steps // 100 * dt)
        energies.append(waves.energy())
    change = np.array(energies) / energies[0] - 1
    trend = np.polyfit(np.linspace(0, 1, len(change)), change, 1)[0]
    return {
        "steps": steps,
        "largest": float(np.abs(change).max()),
        "trend": float(trend),
        "momentum_change": abs(waves.momentum() - momentum),
    }


RESOLUTIONS = (20, 28, 40, 56, 128, 256, 512)
POLYGONS = (2_700, 5_700, 10_700, 21_300)

_SECONDS = 0.1


def steps_per_second(
    resolutions: tuple[int, ...] = RESOLUTIONS, polygons: tuple[int, ...] = POLYGONS, backend: str = "cpu"
) -> dict[str, dict[str, float]]:
    """Substeps a second, and seconds for the atlas, by polygon count and resolution."""
    table = {}
    for count in polygons:
        start = time.perf_counter()
        atlas = build_atlas(knobbly_body(count), resolutions[0], cache=False)
        row = {"sphere map [s]": time.perf_counter() - start}
        for n in resolutions:
            start = time.perf_counter()
            texels = atlas_from_sphere_map(atlas.mesh, atlas.sphere, n)
            operator = build_operator(texels, Material(), "fem")
            row[f"atlas {n} [s]"] = time.perf_counter() - start
            solver = make_backend(backend, operator)
            solver.advance(4, 1e-6)
            steps, best = 4, np.inf
            until = time.perf_counter() + _SECONDS
            while time.perf_counter() < until:
                start = time.perf_counter()
                solver.advance(steps, 1e-6)
                solver.wait()
                best = min(best, (time.perf_counter() - start) / steps)
                steps = max(4, min(200, int(_SECONDS / 5 / best)))
            row[f"steps/s {n}"] = 1 / best
        table[str(count)] = row
    return table


def knobbly_body(polygons: int) -> Mesh:
    """A body with knobs and exactly this (even) number of triangles."""
    points = _spiral(polygons // 2 + 2)
    radius = 1 + 0.25 * np.sin(4 * points[:, :1]) * np.sin(3 * points[:, 1:2] + 1) * np.sin(4 * points[:, 2:] + 2)
    return Mesh.from_arrays(points * radius, ConvexHull(points).simplices, name="knobbly body")


def _spiral(count: int) -> NDArray[np.float64]:
    """Points spread evenly on the unit sphere (the golden spiral)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)


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
    head = ["N", "over naive loop", "one thread each", "ripple-sim", "naive loop"]
    rows = [
        [
            n,
            *(_ratio(row["over naive"]), _ratio(row["one thread over naive"]), _millions(row["cpu"])),
            f"{_millions(row['naive'])} ({'prange' if row['naive'] > row['naive 1'] else 'one thread'})",
        ]
        for n, row in table.items()
    ]
    return _title(
        "CPU against the same stencil as a plain numba loop, in one thread or in all (prange), whichever is faster:\n"
        "ratios, and texel updates a second in millions"
    ) + _grid(head, rows)


def _bounds(table: Mapping[str, Mapping[str, float]]) -> str:
    head = ["N", "of memory bound", "memory bound", "ripple-sim", "scipy", "over scipy"]
    rows = [
        [
            n,
            *(_ratio(row["of stream"]), _millions(row["stream"])),
            *(_millions(row["cpu"]), _millions(row["scipy"]), _ratio(row["one thread over scipy"])),
        ]
        for n, row in table.items()
    ]
    return _title(
        "CPU against the memory bound (28 bytes read and 8 written a texel) and scipy's sparse matrix,\n"
        "in one thread each"
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


SUBSTEPS = 9  # of a frame: what backends and rivals are asked for at once

_ROUNDS = 15
_SECONDS_A_TURN = 0.04


class Advances(Protocol):
    """Anything that takes substeps."""

    def advance(self, substeps: int, dt: float) -> None: ...


class Waited:
    """A GPU backend that is waited for, by reading one number back."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend

    def advance(self, substeps: int, dt: float) -> None:
        """Advance, and wait."""
        self._backend.advance(substeps, dt)
        self._backend.wait()


@dataclasses.dataclass(frozen=True)
class Race:
    """Turns that contestants took in rotation.

    Attributes
    ----------
    texels : int
    seconds : dict
        Seconds a substep of each contestant, round by round.
    """

    texels: int
    seconds: dict[str, list[float]]

    def rates(self) -> dict[str, float]:
        """Texel updates a second of each contestant: the median over the rounds, since load comes and goes."""
        return {name: self.texels / float(np.median(turns)) for name, turns in self.seconds.items()}

    def ratio(self, contestant: str, rival: str) -> float:
        """How many times as fast as its rival a contestant is: the median of that over the rounds."""
        return float(np.median(np.divide(self.seconds[rival], self.seconds[contestant])))


def race(contestants: Mapping[str, Advances], texels: int, rounds: int = _ROUNDS) -> Race:
    """Let contestants take turns of whole frames, so that a busy machine slows all alike."""
    dt = 1e-6
    frames = {}
    for name, contestant in contestants.items():
        contestant.advance(SUBSTEPS, dt)
        start = time.perf_counter()
        contestant.advance(SUBSTEPS, dt)
        frames[name] = max(1, int(_SECONDS_A_TURN / (time.perf_counter() - start)))
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, contestant in contestants.items():
            start = time.perf_counter()
            for _ in range(frames[name]):
                contestant.advance(SUBSTEPS, dt)
            seconds[name].append((time.perf_counter() - start) / (frames[name] * SUBSTEPS))
    return Race(texels, seconds)


def cpu_speed(resolution: int) -> dict[str, float | int]:
    """CPU backend against rivals of one thread, and against the naive loop as it is fastest.

    "cpu" is the backend, which takes one thread; "stream" is the memory bound of one. "naive" is the faster of
    the naive loop in one thread, "naive 1", and in the threads of `numba.prange`, "naive prange". SciPy has one thread.
    Rates are texel updates a second, and ratios those of `Race`.
    """
    operator = _operator(resolution)
    texels = operator.mass.size
    contestants: dict[str, Advances] = {
        "cpu": CPUBackend(operator),
        "naive 1": NaiveLoop(operator),
        "naive prange": NaiveLoop(operator, parallel=True),
        "stream": MemoryStream(texels),
        "scipy": SparseLeapfrog(operator),
    }
    run = race(contestants, texels)
    rates = run.rates()
    naive = max("naive 1", "naive prange", key=lambda name: rates[name])
    return rates | {
        "naive": rates[naive],
        "over naive": run.ratio("cpu", naive),
        "one thread over naive": run.ratio("cpu", "naive 1"),
        "of stream": run.ratio("cpu", "stream"),
        "one thread over scipy": run.ratio("cpu", "scipy"),
    }


def gl_speed(resolution: int) -> dict[str, float] | None:
    """GL backend against the plain shader; None without OpenGL."""
    operator = _operator(resolution)
    try:
        contestants: dict[str, Advances] = {"gl": Waited(make_backend("gl", operator)), "plain": PlainShader(operator)}
    except GLError:
        return None
    run = race(contestants, operator.mass.size)
    return run.rates() | {"over plain": run.ratio("gl", "plain")}


def _operator(resolution: int) -> WaveOperator:
    return build_operator(sphere_atlas(1.0, resolution), Material(), "fem")


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
