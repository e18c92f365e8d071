"""The memory bound: a loop that reads and writes as many bytes as one substep, and computes next to nothing."""

from __future__ import annotations

import functools
import itertools
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats32, kernel

# Streams of float32 that one substep reads at every texel: 4 link weights, gain, height and velocity; and those that
# it writes: velocity and the next height.
READS, WRITES = 7, 2

# Floats of a page of memory. A store and a load at the same place of a page are taken for a conflict: each stream
# begins elsewhere in its page, as in the solver.
_PAGE = 1024

# The compiler makes vector code of short slices, as the solver's kernel has them.
_SLICE = 1024


class Streams(NamedTuple):
    """Arrays of one float32 a texel, [texels]; only the last two are written, and all but the last are read."""

    east: Floats32
    north: Floats32
    northeast: Floats32
    northwest: Floats32
    gain: Floats32
    height: Floats32
    velocity: Floats32
    next_height: Floats32


class MemoryStream:
    """Streams the bytes of a substep through memory, each thread its own share; no thread waits for another."""

    def __init__(self, texels: int, threads: int = 1) -> None:
        count = len(Streams._fields)
        pitch = -(-texels // _PAGE) * _PAGE + _PAGE // count
        # filled, since untouched pages are all one page, which a cache holds
        memory = np.full((count, pitch), 1e-3, np.float32)
        self.streams = Streams(*memory[:, :texels])
        bounds = np.linspace(0, texels, threads + 1).astype(np.int64)
        self._shares = list(itertools.pairwise(bounds))
        self._pool = ThreadPoolExecutor(threads)

    def advance(self, substeps: int, dt: float) -> None:
        """Read and write every stream once a substep; this thread takes the first share itself."""
        passes = functools.partial(_stream, self.streams, substeps, np.float32(dt))
        helpers = [self._pool.submit(passes, *share) for share in self._shares[1:]]
        passes(*self._shares[0])
        for helper in helpers:
            helper.result()


@kernel
def _stream(s: Streams, substeps: int, dt: np.float32, first: int, last: int) -> None:
    """Kick and drift the texels from `first` to `last` by the sum of their weights."""
    for _ in range(substeps):
        for start in range(first, last, _SLICE):
            stop = min(start + _SLICE, last)
            east, north = s.east[start:stop], s.north[start:stop]
            northeast, northwest = s.northeast[start:stop], s.northwest[start:stop]
            gain, height = s.gain[start:stop], s.height[start:stop]
            velocity, next_height = s.velocity[start:stop], s.next_height[start:stop]
            for i in range(stop - start):
                kicked = velocity[i] + dt * gain[i] * (east[i] + north[i] + northeast[i] + northwest[i])
                velocity[i] = kicked
                next_height[i] = height[i] + dt * kicked
