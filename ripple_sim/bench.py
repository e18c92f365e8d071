"""Benchmarks for comparing machines: `ripple-sim bench`.

The speed of the wave step beside the bound of memory, what the coupling costs beside MuJoCo's own
step, and the error of the waves where theory is exact. `examples/benchmarks` compares with other
programs' formulas, and with loops that one would write oneself.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.colliders import make_collidable
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.diagnostics import collect
from ripple_sim.scenes.shapes import DUCK_FILE, duck, ellipsoid, polygonise, smooth_intersection
from ripple_sim.solver import (
    GLError,
    Material,
    Mesh,
    WaveSolver,
    build_atlas,
    load_mesh,
    sphere_atlas,
)
from ripple_sim.solver.backends.choice import make_backend
from ripple_sim.solver.kernel import Floats32, kernel
from ripple_sim.solver.operator.assembly import OPERATORS, build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator

Report = dict[str, Any]
Advance = Callable[[int, float], object]  # takes a number of substeps of some length [s]
Shape = tuple[NDArray[np.float64], NDArray[np.int64]]

# Substeps of a frame, which each contestant takes in one call.
SUBSTEPS = 9

# turns of each contestant
_RACE_ROUNDS = 15

# [s]: length of a turn
_TURN_SECONDS = 0.04

# The bound of memory: a loop that reads and writes as many bytes as a substep, and computes next to
# nothing. Of float32 a texel, a substep reads 4 link weights, gain, height and velocity, and writes
# velocity and the next height.
FIELDS = ("east", "north", "northeast", "northwest", "gain", "height", "velocity", "next height")

# Floats in a page of memory. Processors take a store and a load at the same place of two pages for
# a conflict, so each field begins at another place of its page, as in the solver.
_PAGE_FLOATS = 1024

# Texels of a slice. The compiler vectorises loops over short slices, as in the solver's kernel.
_SLICE_LENGTH = 1024

# Cost of the coupling: bodies of these shapes and half sizes [m] rain on targets that collide as
# their true surface.
_GEOM = mujoco.mjtGeom
_SHAPES = (
    (_GEOM.mjGEOM_SPHERE, (0.06, 0, 0)),
    (_GEOM.mjGEOM_BOX, (0.05, 0.05, 0.05)),
    (_GEOM.mjGEOM_CAPSULE, (0.04, 0.05, 0)),
    (_GEOM.mjGEOM_ELLIPSOID, (0.07, 0.055, 0.04)),
    (_GEOM.mjGEOM_CYLINDER, (0.055, 0.03, 0)),
)
BODIES = 30
RESOLUTION = 128

# [s]: by then all bodies have hit the target, and those that can lie still do
SECONDS = 1.0

# runs, of which the shortest time of each step counts
ROUNDS = 3


def measure(
    meshes: Sequence[Path] = (), say: Callable[[str], object] = lambda stage: None
) -> Report:
    """Measure everything; `say` is called with the name of each stage as it begins.

    Raises
    ------
    MeshError
        Before anything is measured, if a mesh cannot be read.
    """
    loaded = {path.stem: load_mesh(path) for path in [DUCK_FILE, *meshes]}
    info = collect()
    report: Report = {
        "machine": {
            "version": info["versions"]["ripple-sim"],
            "system": info["system"],
            "processors": info["processors"],
            "renderer": info["opengl"]["renderer"] if info["opengl"] else "no OpenGL",
            "software": info["opengl"]["software"] if info["opengl"] else None,
        }
    }
    stages: dict[str, Callable[[], Any]] = {
        "cpu": lambda: {str(n): cpu_speed(n) for n in (128, 256, 512)},
        "gl": lambda: {str(n): gl_speed(n) for n in (128, 256, 512)},
        "meshes": lambda: {name: mesh_cost(mesh) for name, mesh in loaded.items()},
        "coupling": coupling_cost,
        "sphere": sphere_modes,
        "energy": energy_drift,
    }
    for name, run in stages.items():
        say(name)
        report[name] = run()
    return report


def race(
    contestants: Mapping[str, Advance], rounds: int = _RACE_ROUNDS
) -> dict[str, NDArray[np.float64]]:
    """Time the contestants: seconds a substep of each, [rounds].

    They take turns, so that other programs on the machine slow all of them alike.
    """
    dt = 1e-6
    frames = {}
    for name, advance in contestants.items():
        advance(SUBSTEPS, dt)
        start = time.perf_counter()
        advance(SUBSTEPS, dt)
        frames[name] = max(1, int(_TURN_SECONDS / (time.perf_counter() - start)))
    seconds = {name: np.empty(rounds) for name in contestants}
    for i in range(rounds):
        for name, advance in contestants.items():
            start = time.perf_counter()
            for _ in range(frames[name]):
                advance(SUBSTEPS, dt)
            seconds[name][i] = (time.perf_counter() - start) / (frames[name] * SUBSTEPS)
    return seconds


def backend_advance(name: str, operator: WaveOperator) -> Advance:
    """Substeps of a backend, and waiting for them: a GPU says that it has them before it has.

    The surface moves, since steps of a surface at rest cost nothing.
    """
    backend = make_backend(name, operator)
    backend.set_velocity(np.ones(operator.mass.shape, np.float32))

    def advance(substeps: int, dt: float) -> None:
        backend.advance(substeps, dt)
        backend.wait()

    return advance


def cpu_speed(resolution: int) -> dict[str, float]:
    """Texel updates a second of the CPU backend and of the memory bound, and their ratio.

    Both use all cores.

    The smaller fields of N = 128 and 256 lie in the processor's caches, and so does what the bound
    streams there.
    """
    operator = build_operator(sphere_atlas(1.0, resolution), Material(), "fem")
    texels = operator.mass.size
    stream = memory_stream(memory_fields(texels), texels, os.cpu_count() or 1)
    seconds = race({"cpu": backend_advance("cpu", operator), "stream": stream})
    return {
        "cpu": texels / float(np.median(seconds["cpu"])),
        "stream": texels / float(np.median(seconds["stream"])),
        "of stream": float(np.median(seconds["stream"] / seconds["cpu"])),
    }


def gl_speed(resolution: int) -> float | None:
    """Texel updates a second of the GL backend; None without OpenGL."""
    operator = build_operator(sphere_atlas(1.0, resolution), Material(), "fem")
    try:
        advance = backend_advance("gl", operator)
    except GLError:
        return None
    return operator.mass.size / float(np.median(race({"gl": advance})["gl"]))


def mesh_cost(mesh: Mesh, resolution: int = 128) -> dict[str, float]:
    """Seconds for the atlas of a mesh, from nothing, and for a substep of its waves on the CPU."""
    start = time.perf_counter()
    atlas = build_atlas(mesh, resolution, cache=False)
    seconds = time.perf_counter() - start
    step = race({"cpu": backend_advance("cpu", build_operator(atlas, Material(), "fem"))})["cpu"]
    return {
        "triangles": len(mesh.F),
        "texels": int(atlas.areas.size),
        "atlas [s]": seconds,
        "substep [s]": float(np.median(step)),
    }


def memory_fields(texels: int) -> Floats32:
    """Fields of a substep, [fields, texels or more]."""
    # filled, since untouched pages are all one page, which a cache holds
    return np.full(
        (len(FIELDS), -(-texels // _PAGE_FLOATS) * _PAGE_FLOATS + _PAGE_FLOATS // len(FIELDS)),
        1e-3,
        np.float32,
    )


def memory_stream(fields: Floats32, texels: int, threads: int) -> Advance:
    """Stream the bytes of a substep through memory.

    Each thread has a share of its own and waits for no other thread.
    """
    shares = list(itertools.pairwise(np.linspace(0, texels, threads + 1).astype(np.int64)))
    pool = ThreadPoolExecutor(threads)

    def advance(substeps: int, dt: float) -> None:
        for share in [
            pool.submit(_stream, fields, substeps, np.float32(dt), *share) for share in shares
        ]:
            share.result()

    return advance


@kernel
def _stream(fields: Floats32, substeps: int, dt: np.float32, first: int, last: int) -> None:
    """Kick and drift the texels from `first` to `last` by the sum of their weights."""
    for _ in range(substeps):
        for start in range(first, last, _SLICE_LENGTH):
            stop = min(start + _SLICE_LENGTH, last)
            east = fields[0, start:stop]
            north = fields[1, start:stop]
            northeast = fields[2, start:stop]
            northwest = fields[3, start:stop]
            gain = fields[4, start:stop]
            height = fields[5, start:stop]
            velocity = fields[6, start:stop]
            next_height = fields[7, start:stop]
            for i in range(stop - start):
                kicked = velocity[i] + dt * gain[i] * (
                    east[i] + north[i] + northeast[i] + northwest[i]
                )
                velocity[i] = kicked
                next_height[i] = height[i] + dt * kicked


# Accuracy.


def sphere_mode_error(resolution: int, operator: str = "fem") -> float:
    """Relative L2 error of the unit sphere's mode Y_40 after one period, at 1 m/s."""
    atlas = sphere_atlas(1.0, resolution)
    waves = WaveSolver(atlas, backend="cpu", operator=operator)
    z = atlas.positions[..., 2]
    mode = (35 * z**4 - 30 * z**2 + 3) / 8
    waves.height = mode
    waves.step(2 * np.pi / np.sqrt(20))
    return float(
        np.sqrt((atlas.areas * (waves.height - mode) ** 2).sum() / (atlas.areas * mode**2).sum())
    )


def sphere_modes(
    resolutions: tuple[int, ...] = (16, 32, 64, 128, 256),
) -> dict[str, dict[str, float]]:
    """Errors of all operators over the resolution, and their order by regression."""
    table = {}
    for operator in OPERATORS:
        sizes = resolutions if operator == "fem" else tuple(n for n in resolutions if n <= 64)
        errors = [sphere_mode_error(n, operator) for n in sizes]
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        table[operator] = {
            **{str(n): e for n, e in zip(sizes, errors, strict=True)},
            "order": float(order),
        }
    return table


def energy_drift(resolution: int = 64, steps: int = 10_000) -> dict[str, float]:
    """Relative change of the energy in float32 over many steps: largest, and trend over all."""
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


def dish(cell: float = 0.03) -> Shape:
    """Model a thick dish of 1.5 m, in which bodies collect."""
    hollow = ellipsoid((0.0, 0.0, 0.65), (0.8, 0.8, 0.5))
    solid = smooth_intersection(
        0.05, ellipsoid((0.0, 0.0, 0.4), (0.8, 0.8, 0.4)), lambda points: -hollow(points)
    )
    return polygonise(solid, ((-0.9, -0.9, -0.1), (0.9, 0.9, 0.9)), cell)


# Bodies glance off the duck, and roll, slide and lie in the dish.
TARGETS: dict[str, Callable[[], Shape]] = {"duck": duck, "dish": dish}


def coupling_cost(
    targets: Mapping[str, Callable[[], Shape]] = TARGETS,
    seconds: float = SECONDS,
    bodies: int = BODIES,
    resolution: int = RESOLUTION,
    rounds: int = ROUNDS,
) -> dict[str, dict[str, float]]:
    """Seconds a step of `mj_step`, of the coupling and of the waves, by target.

    The coupling is all of `Ripples.step` except the waves.

    The records of impulses, which are made when they are asked for, are counted too. The thread's
    own time is taken. A run is repeated; it is the same each time, so that the shortest time of
    each step is what the step costs.
    """
    table = {}
    for name, shape in targets.items():
        model = rain(shape(), bodies)
        runs = [_run(model, seconds, resolution) for _ in range(rounds)]
        physics, coupling, waves = np.min([times for times, _ in runs], axis=0).mean(axis=0)
        table[name] = {
            "touching": runs[0][1],
            "mj_step [s]": float(physics),
            "coupling [s]": float(coupling),
            "waves [s]": float(waves),
            "of mj_step": float(coupling / physics),
        }
    return table


def rain(shape: Shape, bodies: int) -> mujoco.MjModel:
    """Bodies of five shapes in a cloud over a target on a floor."""
    spec = mujoco.MjSpec()
    rng = np.random.default_rng(0)
    (V, F) = shape
    spec.default.geom.solref = [0.01, 1.0]  # stiff enough for 5 m/s
    spec.add_mesh(name="target", uservert=V.ravel(), userface=F.ravel())
    spec.worldbody.add_geom(name="target", type=_GEOM.mjGEOM_MESH, meshname="target")
    make_collidable(spec, "target")
    spec.worldbody.add_geom(name="floor", type=_GEOM.mjGEOM_PLANE, size=[5, 5, 0.1])
    low = V.min(axis=0)
    high = V.max(axis=0)
    for i in range(bodies):
        x, y = rng.uniform(0.5 * low[:2], 0.5 * high[:2])
        body = spec.worldbody.add_body(
            pos=[x, y, high[2] + 0.2 + 0.04 * i], quat=rng.standard_normal(4)
        )
        body.add_freejoint()
        kind, size = _SHAPES[i % len(_SHAPES)]
        body.add_geom(name=f"body {i}", type=kind, size=size, density=400)
    return spec.compile()


def _run(
    model: mujoco.MjModel, seconds: float, resolution: int
) -> tuple[NDArray[np.float64], float]:
    """Times of every step [s], [steps, 3], and the mean number of bodies on the target.

    The columns are physics, coupling and waves.
    """
    data = mujoco.MjData(model)
    material = Material(speed=0.6, damping=1.0, density=200.0)
    ripples = Ripples(model, {"target": material}, resolution=resolution, backend="cpu")
    ripples.allow_any_height("target")
    take_steps = ripples["target"].step
    in_waves = 0.0

    def timed(*arguments: Any, **options: Any) -> None:
        nonlocal in_waves
        begun = time.thread_time()
        take_steps(*arguments, **options)
        in_waves += time.thread_time() - begun

    ripples["target"].step = timed  # type: ignore[method-assign]
    times = []
    pairs = 0
    for _ in range(round(seconds / model.opt.timestep)):
        in_waves = 0.0
        start = time.thread_time()
        mujoco.mj_step(model, data)
        moved = time.thread_time()
        ripples.step(data)
        pairs += len(ripples.last_impulses)
        times.append((moved - start, time.thread_time() - moved - in_waves, in_waves))
    return np.array(times), pairs / len(times)


# The report as text.


def as_text(report: Mapping[str, Any]) -> str:
    """Lay a report out for reading: a title and a table for each measurement."""
    machine = report["machine"]
    energy = report["energy"]
    return "\n\n".join(
        [
            f"{machine['processors']} processors, {machine['renderer']}\n"
            f"ripple-sim {machine['version']}",
            "Texel updates a second, in millions; the memory bound reads 28 bytes and writes "
            "8 a texel, in all cores\n" + _rate_table(report["cpu"], report["gl"]),
            "Meshes at N = 128: seconds for the atlas, and milliseconds a wave step on the CPU\n"
            + _mesh_table(report["meshes"]),
            f"Coupling: {BODIES} bodies rain on a target that collides as its true surface, "
            "ms a step\n" + _coupling_table(report["coupling"]),
            "Unit sphere, mode Y40 after one period: relative L2 error, and order by regression\n"
            + _mode_table(report["sphere"]),
            "Energy without damping, float32\n"
            f"over {energy['steps']:,} steps: largest relative change {energy['largest']:.1e}, "
            f"trend {energy['trend']:+.1e}",
        ]
    )


def _rate_table(cpu: Mapping[Any, Any], gl: Mapping[Any, float | None]) -> str:
    """Texel updates a second on the CPU, beside the bound of memory, and on the GPU."""
    rows = []
    for n, measured in cpu.items():
        gl_rate = gl.get(n)
        rows.append(
            [
                n,
                f"{measured['cpu'] / 1e6:,.0f}",
                f"{measured['stream'] / 1e6:,.0f}",
                f"{measured['of stream']:.2f}",
                "" if gl_rate is None else f"{gl_rate / 1e6:,.0f}",
            ]
        )
    return table(["N", "CPU", "memory bound", "of it", "OpenGL"], rows)


def _mesh_table(meshes: Mapping[str, Any]) -> str:
    """Times of the atlas and of a step, by mesh."""
    rows = []
    for name, measured in meshes.items():
        rows.append(
            [
                name,
                f"{measured['triangles']:,}",
                f"{measured['texels']:,}",
                f"{measured['atlas [s]']:.2f}",
                f"{1e3 * measured['substep [s]']:.3f}",
            ]
        )
    return table(["mesh", "triangles", "texels", "atlas", "step"], rows)


def _coupling_table(targets: Mapping[str, Any]) -> str:
    """Times of a physics step, of the coupling and of the waves, by target."""
    rows = []
    for name, measured in targets.items():
        rows.append(
            [
                name,
                f"{measured['touching']:.1f}",
                f"{1e3 * measured['mj_step [s]']:.3f}",
                f"{1e3 * measured['coupling [s]']:.3f}",
                f"{1e3 * measured['waves [s]']:.3f}",
                f"{measured['of mj_step']:.2f}",
            ]
        )
    head = ["target", "touching", "mj_step", "coupling", "waves", "coupling over mj_step"]
    return table(head, rows)


def _mode_table(operators: Mapping[str, Any]) -> str:
    """Errors of a mode, by operator and resolution."""
    columns = list(operators["fem"])
    rows = []
    for name, errors in operators.items():
        row = [name]
        for column in columns:
            row.append(f"{errors[column]:.3g}" if column in errors else "")
        rows.append(row)
    head = ["operator"]
    for column in columns:
        head.append(column if column == "order" else f"N = {column}")
    return table(head, rows)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Align columns: the first to the left, the others to the right."""
    columns = list(zip(head, *rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    lines = []
    for first, *others in [head, *rows]:
        cells = [first.ljust(widths[0])]
        for cell, width in zip(others, widths[1:], strict=True):
            cells.append(cell.rjust(width))
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
