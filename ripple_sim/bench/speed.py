"""How fast the backends are, against rivals that take turns with them, so that a busy machine slows all alike."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from ripple_sim.solver import GLError, Material, sphere_atlas
from ripple_sim.solver.waves.backends.backend import Backend, make_backend
from ripple_sim.solver.waves.backends.cpu import CPUBackend
from ripple_sim.solver.waves.operator import WaveOperator, build_operator

from .rivals.memory_stream import MemoryStream
from .rivals.naive_loop import NaiveLoop
from .rivals.plain_shader import PlainShader
from .rivals.sparse_leapfrog import SparseLeapfrog

_ROUNDS = 7
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


def updates_per_second(contestants: Mapping[str, Advances], texels: int) -> dict[str, float]:
    """Texel updates a second of each, the best of several turns taken in rotation."""
    dt = 1e-6
    counts = {}
    for name, contestant in contestants.items():
        contestant.advance(2, dt)
        start = time.perf_counter()
        contestant.advance(2, dt)
        counts[name] = max(2, int(_SECONDS_A_TURN / (time.perf_counter() - start) * 2))
    best = dict.fromkeys(contestants, np.inf)
    for _ in range(_ROUNDS):
        for name, contestant in contestants.items():
            start = time.perf_counter()
            contestant.advance(counts[name], dt)
            best[name] = min(best[name], (time.perf_counter() - start) / counts[name])
    return {name: texels / seconds for name, seconds in best.items()}


def cpu_speed(resolution: int) -> dict[str, float | int]:
    """CPU backend against rivals of as many threads, and against the naive loop as it is fastest.

    "cpu" is the backend as the solver takes it, "cpu 1" in one thread; likewise "stream", the memory bound. "naive" is
    the faster of the naive loop in one thread, "naive 1", and in the threads of `numba.prange`, "naive prange". SciPy
    has one thread. Rates are texel updates a second.
    """
    operator = _operator(resolution)
    texels, backend = operator.mass.size, CPUBackend(operator)
    contestants: dict[str, Advances] = {
        "cpu": backend,
        "cpu 1": CPUBackend(operator, 1),
        "naive 1": NaiveLoop(operator),
        "naive prange": NaiveLoop(operator, parallel=True),
        "stream": MemoryStream(texels, backend.thread_count),
        "stream 1": MemoryStream(texels),
        "scipy": SparseLeapfrog(operator),
    }
    rates = updates_per_second(contestants, texels)
    naive = max(rates["naive 1"], rates["naive prange"])
    return {"threads": backend.thread_count, **rates} | {
        "naive": naive,
        "over naive": rates["cpu"] / naive,
        "one thread over naive": rates["cpu 1"] / rates["naive 1"],
        "of stream": rates["cpu"] / rates["stream"],
        "one thread of stream": rates["cpu 1"] / rates["stream 1"],
        "one thread over scipy": rates["cpu 1"] / rates["scipy"],
    }


def gl_speed(resolution: int) -> dict[str, float] | None:
    """GL backend against the plain shader; None without OpenGL."""
    operator = _operator(resolution)
    try:
        contestants: dict[str, Advances] = {"gl": Waited(make_backend("gl", operator)), "plain": PlainShader(operator)}
    except GLError:
        return None
    rates = updates_per_second(contestants, operator.mass.size)
    return rates | {"over plain": rates["gl"] / rates["plain"]}


def _operator(resolution: int) -> WaveOperator:
    return build_operator(sphere_atlas(1.0, resolution), Material(), "fem")
