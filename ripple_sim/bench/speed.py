"""How fast the backends are, against rivals that take turns with them, so that a busy machine slows all alike."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from ripple_sim.solver import GLError, Material, sphere_atlas
from ripple_sim.solver.backends import blocks
from ripple_sim.solver.backends.backend import Backend, make_backend
from ripple_sim.solver.backends.cpu import CPUBackend
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator

from .memory_stream import MemoryStream
from .plain_shader import PlainShader
from .rivals import NaiveLoop
from .sparse_leapfrog import SparseLeapfrog

SUBSTEPS = 9  # of a frame: what backends and rivals are asked for at once

_ROUNDS = 15
_SECONDS_A_TURN = 0.04


class Advances(Protocol):
    """Anything that takes substeps."""

    def advance(self, substeps: int, dt: float) -> None: ...  # noqa: D102


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
    """CPU backend against rivals of as many threads, and against the naive loop as it is fastest.

    "cpu" is the backend as the solver takes it, "cpu 1" in one thread, "cpu all" in as many as the machine has cores;
    likewise "stream", the memory bound. "naive" is
    the faster of the naive loop in one thread, "naive 1", and in the threads of `numba.prange`, "naive prange". SciPy
    has one thread. Rates are texel updates a second, and ratios those of `Race`.
    """
    operator = _operator(resolution)
    texels, backend = operator.mass.size, CPUBackend(operator)
    contestants: dict[str, Advances] = {
        "cpu": backend,
        "cpu 1": CPUBackend(operator, 1),
        "cpu all": CPUBackend(operator, blocks.available()),
        "naive 1": NaiveLoop(operator),
        "naive prange": NaiveLoop(operator, parallel=True),
        "stream": MemoryStream(texels, backend.thread_count),
        "stream 1": MemoryStream(texels),
        "scipy": SparseLeapfrog(operator),
    }
    run = race(contestants, texels)
    rates = run.rates()
    naive = max("naive 1", "naive prange", key=lambda name: rates[name])
    return {"threads": backend.thread_count, **rates} | {
        "naive": rates[naive],
        "over naive": run.ratio("cpu", naive),
        "one thread over naive": run.ratio("cpu 1", "naive 1"),
        "all threads over naive": run.ratio("cpu all", "naive prange"),
        "of stream": run.ratio("cpu", "stream"),
        "one thread of stream": run.ratio("cpu 1", "stream 1"),
        "one thread over scipy": run.ratio("cpu 1", "scipy"),
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
