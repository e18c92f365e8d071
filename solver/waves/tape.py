"""`Tape`: a recording of everything that drives a surface's waves, for playing them elsewhere.

A backend's `kick`, `hold` and `advance` are all that a solver does to its fields while it runs.
A program that can do these three can compute the same waves from a tape.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..backends.backend import Backend, TexelLoad
from ..backends.step_kernels import Amplitude
from ..operator.wave_operator import WaveOperator

# What a tape holds, in order:
# ("load", texels, forces): these forces [N], outwards, act from now on, until the next load;
# ("kick", texels, velocities): these velocities [m/s] are added now;
# ("step", substeps, dt): so many substeps of dt [s].
Event: TypeAlias = tuple[str, Any, Any]


class Tape:
    """The events of one surface since the latest `take`; see `WaveSolver.record`.

    Attributes
    ----------
    events : list
        See `Event`. What keeps the volume follows from loads and kicks, and is not in them.
    broken : str
        What happened that no event describes, in words after the surface's name; empty: nothing.
    """

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.broken = ""

    def take(self) -> list[Event]:
        """The events so far; the tape is then empty."""
        events = self.events
        self.events = []
        return events


class RecordedBackend:
    """A backend that also passes its calls to tapes; everything else goes to the backend."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.tapes: list[Tape] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.backend, name)

    @property
    def keeps_volume(self) -> bool | None:
        """See `Backend`."""
        return self.backend.keeps_volume

    @keeps_volume.setter
    def keeps_volume(self, value: bool | None) -> None:
        if value != self.backend.keeps_volume:
            self.break_off("changes whether it keeps its volume")
        self.backend.keeps_volume = value

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """See `Backend`."""
        self._tell("kick", texels, velocities)
        self.backend.kick(texels, velocities, everywhere)

    def hold(self, load: TexelLoad) -> None:
        """See `Backend`."""
        self._tell("load", load.texels, load.forces)
        self.backend.hold(load)

    def advance(self, substeps: int, dt: float) -> None:
        """See `Backend`."""
        self._tell("step", substeps, dt)
        self.backend.advance(substeps, dt)

    def move(self, operator: WaveOperator) -> None:
        """See `Backend`."""
        self.break_off("moves by itself")
        self.backend.move(operator)

    def _tell(self, kind: str, first: Any, second: Any) -> None:
        for tape in self.tapes:
            tape.events.append((kind, first, second))

    def break_off(self, reason: str) -> None:
        """Tell the tapes why they end, in words after the surface's name; no event describes it."""
        for tape in self.tapes:
            tape.broken = tape.broken or reason
