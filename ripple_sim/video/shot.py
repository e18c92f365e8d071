"""`Shot`: everything that one exposure of a film shows."""

from __future__ import annotations

import dataclasses

from ripple_sim.capture.snapshot import Snapshot
from ripple_sim.overlay.notes import Notes


@dataclasses.dataclass(frozen=True, eq=False)
class Shot:
    """An exposure of a film's frame: a snapshot of each run, and the overlays' content, which a whole frame shares."""

    snapshots: tuple[Snapshot, ...]
    notes: Notes

    @property
    def number(self) -> int:
        """Of the frame, from 0."""
        return self.snapshots[0].number

    @property
    def exposure(self) -> int:
        """Of the frame's exposures, from 0."""
        return self.snapshots[0].exposure

    def digest(self) -> str:
        """Fingerprint of all runs, see `Snapshot.digest`."""
        return "".join(snapshot.digest() for snapshot in self.snapshots)
