"""Passes beside the frames of a film."""

from __future__ import annotations

from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.passes import Sighting, passes_of
from ripple_sim.capture.snapshot import Snapshot
from ripple_sim.coupling.geoms import geom_name
from ripple_sim.encode.images import PassFiles
from ripple_sim.simulation import Simulation


class PassWriter:
    """Writes the passes of one frame when the next one is seen, to which its pixels flow.

    Parameters
    ----------
    files : PassFiles
    names : tuple of str
        Of the passes.
    """

    def __init__(self, files: PassFiles, names: tuple[str, ...]) -> None:
        self._files, self._names = files, names
        self._last: tuple[int, Sighting] | None = None

    def add(self, source: FrameSource, snapshot: Snapshot) -> None:
        """Look at the first exposure of a frame."""
        sighting = source.sighting(snapshot)
        self._write(sighting)
        self._last = snapshot.number, sighting

    def finish(self) -> None:
        """Write the last frame's, where nothing flows."""
        self._write(None)

    def _write(self, later: Sighting | None) -> None:
        if self._last is not None:
            number, sighting = self._last
            self._files.write(number, passes_of(sighting, later, self._names))


def segmented(simulation: Simulation) -> dict[int, str]:
    """What each number of the segmentation stands for: 0 the background, from 1 on the geoms."""
    model = simulation.model
    soft = {target + 1: name for name, target in simulation.ripples.geom_ids.items() if target >= model.ngeom}
    return {0: "background", **{geom + 1: geom_name(model, geom) for geom in range(model.ngeom)}, **soft}
