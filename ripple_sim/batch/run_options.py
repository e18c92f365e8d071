"""How a batch is run, and how far a run is."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How a batch is run; none of it changes a byte of the scenes."""

    workers: int | None = None
    """Processes of this machine; by default one for every two cores, at least two where there are two."""
    shard: tuple[int, int] = (1, 1)
    """Which part of the scenes to make, of how many."""
    limit: int | None = None
    """At most so many scenes in this run."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers make the scenes."""
    retry_failed: bool = False
    """Try the scenes again that were put aside."""
    keep_free: float = 1e9
    """Stop when the disk has no more room than this [bytes]."""


@dataclasses.dataclass
class Progress:
    """How far a batch is.

    Attributes
    ----------
    scenes, finished, aside : int
        Of this run's share: all, those that are there, those that have been put aside.
    made, frames, bytes, failures : int
        By this run: scenes, their frames and size on the disk, and scenes that failed once or more.
    seconds : float
        That this run has taken so far [s].
    free : int
        Room left on the disk [bytes].
    """

    scenes: int
    finished: int
    aside: int
    made: int = 0
    frames: int = 0
    bytes: int = 0
    failures: int = 0
    seconds: float = 0.0
    free: int = 0
