"""`Summary`: what a rendered video took."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import NamedTuple

from ripple_sim.encode import FrameWriter
from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.kernel import compile_times, work_clock

from .film import Film


class Times(NamedTuple):
    """A moment [s]: on the wall's clock, on this thread's `work_clock`, and the time of compilation so far."""

    wall: float
    work: float
    compiled: float

    @classmethod
    def now(cls) -> Times:
        """Take the time."""
        return cls(time.perf_counter(), work_clock(), sum(compile_times().values()))


@dataclasses.dataclass(frozen=True)
class Summary:
    """What a rendered video took.

    Of its `frames`, those before `resumed_at` were there already. `renderer` is the driver's GL_RENDERER, `backend` the
    wave solver's. Times in seconds; the stages overlap, so they add up to more than `wall_seconds`. What was spent on
    compiling kernels, at their first use on a machine, is told apart from the work of the stages.
    """

    output: Path
    frames: int
    resumed_at: int
    renderer: str
    backend: str
    substeps_per_frame: float
    compile_seconds: float
    setup_seconds: float
    physics_seconds: float
    wave_seconds: float
    render_seconds: float
    encode_seconds: float
    wall_seconds: float

    @classmethod
    def of(
        cls, film: Film, writer: FrameWriter, gl: GLContext, *, resumed_at: int, started: Times, ready: Times
    ) -> Summary:
        """Summary of a film that has been written; it was started, and its first frame could begin, at these times."""
        simulations, ended = film.simulations, Times.now()
        return cls(
            output=writer.path,
            frames=writer.frames,
            resumed_at=resumed_at,
            renderer=gl.renderer,
            backend=simulations[0].backend,
            substeps_per_frame=sum(each.substeps_taken for each in simulations) / max(writer.frames - 1, 1),
            compile_seconds=ended.compiled - started.compiled,
            setup_seconds=ready.work - started.work,
            physics_seconds=sum(each.physics_seconds for each in simulations),
            wave_seconds=sum(each.wave_seconds for each in simulations),
            render_seconds=film.seconds,
            encode_seconds=writer.encode_seconds,
            wall_seconds=ended.wall - started.wall,
        )
