"""The content of the overlays, gathered from running simulations frame by frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ripple_sim.scene.overlays import Request
from ripple_sim.simulation import Simulation
from ripple_sim.solver.texels.topology import with_filled_halo

from .contact_marks import ContactMarks, Mark
from .heatmap import magnitude
from .history import History
from .scale import Limit

# The colours end at this share of the targets' size, or of their wave speed, until higher waves come.
_LEAST = 1e-3
# A contact's first dent is much deeper than its waves, but brief [s].
_MEMORY = 0.25


@dataclasses.dataclass(frozen=True, eq=False)
class Scale:
    """The present end of a scale, and the round number that it approaches."""

    value: float
    goal: float


@dataclasses.dataclass(frozen=True, eq=False)
class Notes:
    """The overlays' content for one frame; each sequence has one item per run.

    Attributes
    ----------
    time : float
        [s].
    heatmaps : sequence of dict
        By the geom's name: what its colours show, float32 [C, n + 2, n + 2], with halo.
    heatmap_scale, mark_scale, energy_scale : Scale
    marks : sequence of list of Mark
    energies : sequence of (times [s], energies [J])
        From the beginning.
    """

    time: float
    heatmaps: Sequence[dict[str, NDArray[np.float32]]]
    heatmap_scale: Scale
    marks: Sequence[list[Mark]]
    mark_scale: Scale
    energies: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
    energy_scale: Scale


class Notebook:
    """Follows simulations that run in step, as far as the requested overlays need it.

    Parameters
    ----------
    request : Request
    simulations : sequence of Simulation
        All of one scene; they share their scales.
    frames : int
        How many there will be.
    rate : float
        Frames in a second of the scene's time.
    """

    def __init__(self, request: Request, simulations: Sequence[Simulation], frames: int, rate: float) -> None:
        self._request, self._simulations, self._dt = request, simulations, 1 / rate
        self._heatmap_limit = Limit(self._least_limit(), request.limit, _MEMORY)
        self._mark_limit, self._energy_limit = Limit(), Limit()
        self._marks = [ContactMarks(simulation, self._dt) for simulation in simulations]
        self._energies = [History(frames) for _ in simulations]

    def follow(self) -> Notes:
        """Take in the simulations' present frame. Call it for every frame, rendered or not."""
        request = self._request
        heatmaps = [self._heatmaps(simulation) for simulation in self._simulations] if request.heatmap else []
        marks = [gatherer.follow() for gatherer in self._marks] if request.contacts else []
        if request.energy:
            for history, simulation in zip(self._energies, self._simulations, strict=True):
                history.add(sum(simulation.ripples[name].energy() for name in simulation.ripples))
        magnitudes = [magnitude(heatmap) for run in heatmaps for heatmap in run.values()]
        curves = [history.curve() for history in self._energies]
        return Notes(
            time=float(self._simulations[0].data.time),
            heatmaps=heatmaps,
            heatmap_scale=self._scale(self._heatmap_limit, magnitudes),
            marks=marks,
            mark_scale=self._scale(self._mark_limit, [mark.impulse for run in marks for mark in run]),
            energies=[(frames * self._dt, values) for frames, values in curves],
            energy_scale=self._scale(self._energy_limit, [values[-1] for _, values in curves if len(values)]),
        )

    def _scale(self, limit: Limit, magnitudes: Sequence[float]) -> Scale:
        return Scale(limit.follow(max(magnitudes, default=0.0), self._dt), limit.goal)

    def _heatmaps(self, simulation: Simulation) -> dict[str, NDArray[np.float32]]:
        ripples = simulation.ripples
        shown = self._request.heatmap or ""
        return {
            name: with_filled_halo(waves.atlas.texels.topology, getattr(waves, shown))
            for name, waves in ((name, ripples[name]) for name in ripples)
        }

    def _least_limit(self) -> float:
        ripples = self._simulations[0].ripples
        sizes = [float(np.ptp(ripples[name].atlas.mesh.V, axis=0).max()) for name in ripples]
        if self._request.heatmap != "velocity":
            return _LEAST * max(sizes)
        return _LEAST * max(float(np.max(ripples[name].material.speed)) for name in ripples)
