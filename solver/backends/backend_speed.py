"""Which backend is faster on this machine: measured once, and kept in the user's cache folder."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import itertools
import os
import platform
import time
from typing import NamedTuple

import numpy as np

from ..cache import cache_limit, cache_path, mark_used
from ..files import atomic_write
from ..gl import GLContext
from ..layouts.cube.convention import cube_topology
from ..operator.wave_operator import WaveOperator
from ..texels.stencil import Stencil
from .backend import Backend
from .cpu import CPUBackend
from .gl import GLBackend

_SIZES = (64, 192)  # texels along a chart's side, at the two sizes that are measured
_FRAME_SUBSTEPS = 9  # substeps of a frame

# Each backend runs at each size for at least this long [s], and at least this many frames.
_MIN_SECONDS = 0.03
_MIN_FRAMES = 3


class Measured(NamedTuple):
    """Time that the substeps of a frame take on both backends, at two sizes."""

    texels: tuple[float, float]  # number of texels at each size
    gl: tuple[float, float]  # [s]
    cpu: tuple[float, float]  # [s]

    def faster(self, texels: int) -> str:
        """The faster backend for a number of texels, "gl" or "cpu".

        The time is taken to be linear in the number of texels.
        """
        small, large = self.texels
        share = (texels - small) / (large - small)
        gl_time = self.gl[0] + share * (self.gl[1] - self.gl[0])
        cpu_time = self.cpu[0] + share * (self.cpu[1] - self.cpu[0])
        return "gl" if gl_time < cpu_time else "cpu"

    def __str__(self) -> str:
        rows = zip(self.texels, self.gl, self.cpu, strict=True)
        return "; ".join(
            f"{n:,.0f} texels: {1e3 * gl:.2f} ms GL, {1e3 * cpu:.2f} ms CPU" for n, gl, cpu in rows
        )


@functools.cache
def measured(gl: GLContext) -> Measured:
    """The measurement of a device and its driver on this machine, from the cache or taken now."""
    program = importlib.metadata.version("ripple-sim")
    path = cache_path(
        f"backends {gl.renderer} {gl.version} {platform.machine()} {os.cpu_count()} {program}", []
    )
    with contextlib.suppress(OSError, ValueError, KeyError):
        with np.load(path, allow_pickle=False) as file:
            cached = Measured(*(tuple(file[name].tolist()) for name in Measured._fields))
        mark_used(path)
        return cached
    measurement = measure(gl)
    if cache_limit():
        # where the file cannot be written, the next process measures again
        with (
            contextlib.suppress(OSError),
            atomic_write(path) as unfinished,
            unfinished.open("wb") as file,
        ):
            np.savez(file, allow_pickle=False, **measurement._asdict())
    return measurement


def measure(gl: GLContext) -> Measured:
    """Time both backends at both sizes."""
    gl_times = []
    cpu_times = []
    for n in _SIZES:
        operator = _cube_operator(n)
        gl_times.append(_frame_time(GLBackend(operator, gl)))
        cpu_times.append(_frame_time(CPUBackend(operator)))
    small, large = (6.0 * n * n for n in _SIZES)
    return Measured((small, large), (gl_times[0], gl_times[1]), (cpu_times[0], cpu_times[1]))


def _cube_operator(n: int) -> WaveOperator:
    """An operator on a cube whose links have weight 0: the time does not depend on the numbers."""
    topology = cube_topology(n)
    ones = np.ones(topology.shape)
    stencil = Stencil(topology, np.zeros((6, 4, n + 1, n + 1)))
    return WaveOperator(stencil, ones, 0 * ones, 0 * ones)


def _frame_time(backend: Backend) -> float:
    """The least time of a frame's substeps [s]; the first frame, which compiles, does not count."""
    # steps of a surface at rest cost nothing
    backend.set_velocity(np.ones(backend.fields.shape, np.float32))
    ends: list[float] = []
    while len(ends) <= _MIN_FRAMES or ends[-1] - ends[0] < _MIN_SECONDS:
        backend.advance(_FRAME_SUBSTEPS, 1e-3)
        backend.wait()
        ends.append(time.perf_counter())
    return min(end - start for start, end in itertools.pairwise(ends))
