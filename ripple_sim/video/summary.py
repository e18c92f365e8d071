"""`Summary`: what a rendered video took."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

from ripple_sim.encode import FrameWriter
from ripple_sim.solver.gl import GLContext

from .film import Film


@dataclasses.dataclass(frozen=True)
class Summary:
    """What a rendered video took.

    Of its `frames`, those before `resumed_at` were there already. `renderer` is the driver's GL_RENDERER, `backend` the
    wave solver's. Times in seconds; the stages overlap, so they add up to more than `wall_seconds`.
    """

    output: Path
    frames: int
    resumed_at: int
    renderer: str
    backend: str
    substeps_per_frame: float
    setup_seconds: float
    physics_seconds: float
    wave_seconds: float
    render_seconds: float
    encode_seconds: float
    wall_seconds: float

    @classmethod
    def of(
        cls, film: Film, writer: FrameWriter, gl: GLContext, *, resumed_at: int, started: float, ready: float
    ) -> Summary:
        """Summary of a film that has been written; the times are those of `time.perf_counter`."""
        simulations = film.simulations
        return cls(
            output=writer.path,
            frames=writer.frames,
            resumed_at=resumed_at,
            renderer=gl.renderer,
            backend=simulations[0].backend,
            substeps_per_frame=sum(each.substeps_taken for each in simulations) / max(writer.frames - 1, 1),
            setup_seconds=ready - started,
            physics_seconds=sum(each.physics_seconds for each in simulations),
            wave_seconds=sum(each.wave_seconds for each in simulations),
            render_seconds=film.seconds,
            encode_seconds=writer.encode_seconds,
            wall_seconds=time.perf_counter() - started,
        )
