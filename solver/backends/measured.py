"""Which backend is faster on this machine: measured once, and remembered in the user's cache folder."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import os
import platform
import time
from typing import NamedTuple

import numpy as np

from ..atomic_file import atomic_write
from ..cache import cache_limit, cache_path, mark_used
from ..gl import GLContext
from ..layouts.cube.convention import cube_topology
from ..operator.wave_operator import WaveOperator
from ..texels.stencil import Stencil
from .cpu import CPUBackend
from .gl import GLBackend

# Texels along a chart's side of the two sizes that are measured, and substeps of a frame.
_SIZES, _SUBSTEPS = (64, 192), 9

# How long each backend is measured at each size [s], and how often at least.
_SPELL, _LEAST = 0.03, 3


class Measured(NamedTuple):
    """Seconds that nine substeps take on both backends, at two sizes.

    Attributes
    ----------
    texels : (int, int)
    gl, cpu : (float, float)
        [s].
    """

    texels: tuple[float, float]
    gl: tuple[float, float]
    cpu: tuple[float, float]

    def faster(self, texels: int) -> str:
        """The faster backend, "gl" or "cpu", of so many texels: time is taken to be linear in their number."""
        share = (texels - self.texels[0]) / (self.texels[1] - self.texels[0])
        gl, cpu = (each[0] + share * (each[1] - each[0]) for each in (self.gl, self.cpu))
        return "gl" if gl < cpu else "cpu"

    def __str__(self) -> str:
        rows = zip(self.texels, self.gl, self.cpu, strict=True)
        return "; ".join(f"{n:,.0f} texels: {1e3 * gl:.2f} ms GL, {1e3 * cpu:.2f} ms CPU" for n, gl, cpu in rows)


@functools.cache
def measured(gl: GLContext) -> Measured:
    """The measurement of a device and its driver on this machine, taken now if there is none in the cache."""
    machine = (
        gl.renderer,
        gl.version,
        platform.machine(),
        str(os.cpu_count()),
        importlib.metadata.version("ripple-sim"),
    )
    path = cache_path(f"backends {' '.join(machine)}", [])
    with contextlib.suppress(OSError, ValueError, KeyError):
        with np.load(path, allow_pickle=False) as kept:
            known = Measured(*(tuple(kept[name].tolist()) for name in Measured._fields))
        mark_used(path)
        return known
    found = measure(gl)
    if cache_limit():
        # one that cannot be written is measured again by the next process
        with contextlib.suppress(OSError), atomic_write(path) as unfinished, unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **found._asdict())
    return found


def measure(gl: GLContext) -> Measured:
    """Time both backends at both sizes."""
    times: dict[str, list[float]] = {"gl": [], "cpu": []}
    for n in _SIZES:
        operator = _plain_operator(n)
        for backend in (GLBackend(operator, gl), CPUBackend(operator)):
            times[backend.name].append(_seconds(backend))
    texels = [6.0 * n * n for n in _SIZES]
    return Measured(*(tuple(each) for each in (texels, times["gl"], times["cpu"])))  # type: ignore[arg-type]


def _plain_operator(n: int) -> WaveOperator:
    """Of a cube of n x n texels a face, without links: what the numbers are makes no difference to the time."""
    topology = cube_topology(n)
    ones = np.ones(topology.shape)
    return WaveOperator(Stencil(topology, np.zeros((6, 4, n + 1, n + 1))), ones, 0 * ones, 0 * ones)


def _seconds(backend: GLBackend | CPUBackend) -> float:
    """The least time of a frame's substeps [s]; the first, which compiles, does not count."""
    least, count, begun = np.inf, 0, 0.0
    while count <= _LEAST or time.perf_counter() - begun < _SPELL:
        start = time.perf_counter()
        backend.advance(_SUBSTEPS, 1e-3)
        backend.wait()
        now = time.perf_counter()
        least, begun = (min(least, now - start), begun) if count else (least, now)
        count += 1
    return float(least)
