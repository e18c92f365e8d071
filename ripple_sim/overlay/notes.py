"""The content of the overlays, gathered from running simulations frame by frame.

`Notebook` follows one simulation, or two of one scene side by side, and makes the `Notes` of each
frame: fields for heatmaps, marks of contacts, energies so far, and the ends of their scales.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.energy import Energy
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.scene.overlays import Request
from ripple_sim.simulation import Simulation
from ripple_sim.solver.texels.halo import with_filled_halo
from ripple_sim.solver.waves.sensor import UNITS, Sensor

from .marks import ContactMarks, Mark
from .scales import Limit, Scale

COLUMNS = 512  # of the trace of a sensor, at most

# Points of a curve, at most: more than the energy plot has columns of pixels, save on very large
# frames.
MOST_POINTS = 1024

# Least end of the colours, over the size of the largest target or its wave speed.
_MIN_HEATMAP_LIMIT = 1e-3

# Time over which the magnitudes of heatmaps are averaged [s]: the first dent of a contact is much
# deeper than its waves, but brief.
_HEATMAP_MEMORY = 0.25


def magnitude(field: NDArray[np.float32]) -> float:
    """Mean magnitude of a field with halo, weighted by the magnitude itself.

    It says how high the waves are: the calm surface around a small wave does not count, and the few
    texels in the dent under a contact count little.
    """
    inside = np.abs(field[:, 1:-1, 1:-1]).ravel()
    total = float(inside.sum(dtype=np.float64))
    return float(np.dot(inside, inside)) / total if total else 0.0


def grid_spacing(resolution: int) -> int:
    """Texels between grid lines: a power of two.

    There are 16 to 31 cells along a chart; on a chart of fewer texels, each texel is a cell.
    """
    return 1 << max(0, (resolution // 16).bit_length() - 1)


def curve(
    values: NDArray[np.float64], frames: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frame numbers and values of a curve with at most `MOST_POINTS` points.

    Each point stands for the same number of frames, and has their largest value.

    Parameters
    ----------
    values : float64 [n]
        Of the frames so far.
    frames : int
        Number of frames that there will be.
    """
    frames_per_point = -(-frames // MOST_POINTS)
    begins = np.arange(0, len(values), frames_per_point)
    largest = np.maximum.reduceat(values, begins) if len(values) else np.zeros(0)
    return begins.astype(np.float64), largest


class Trace(NamedTuple):
    """The signal of the first point of a sensor over the time so far, in columns.

    Attributes
    ----------
    name : str
        Of the sensor.
    times : float64 [k]
        At which the columns begin [s].
    low, high : float32 [k]
        Least and greatest value within each column.
    unit : str
        Of the values.
    """

    name: str
    times: NDArray[np.float64]
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    unit: str


@dataclasses.dataclass(frozen=True, eq=False)
class Notes:
    """The content of the overlays for one frame; each sequence has one item for each run.

    Attributes
    ----------
    time : float
        [s].
    heatmaps : sequence of dict
        The field that the colours show, float32 [C, n + 2, n + 2] with halo, by target.
    heatmap_scale, mark_scale, energy_scale : Scale
    marks : sequence of list of Mark
    energies : sequence of (times [s], energies [J])
        Of the waves, from the beginning.
    ledgers : sequence of Energy
        Of bodies, waves and both, at the time of the frame.
    traces : sequence of Trace
        Of the sensors of the first run.
    """

    time: float
    heatmaps: Sequence[dict[str, NDArray[np.float32]]]
    heatmap_scale: Scale
    marks: Sequence[list[Mark]]
    mark_scale: Scale
    energies: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]
    energy_scale: Scale
    ledgers: Sequence[Energy] = ()
    traces: Sequence[Trace] = ()


def traces(sensors: Mapping[str, Sensor]) -> list[Trace]:
    """The signals of sensors so far, in at most `COLUMNS` columns of equal length."""
    result = []
    for name, sensor in sensors.items():
        values = sensor.samples[:, 0]
        samples_per_column = max(1, -(-len(values) // COLUMNS))
        begins = np.arange(0, len(values), samples_per_column)
        low = np.minimum.reduceat(values, begins) if len(values) else values
        high = np.maximum.reduceat(values, begins) if len(values) else values
        result.append(Trace(name, sensor.times[begins], low, high, UNITS[sensor.kind]))
    return result


class Notebook:
    """Follows simulations that run in step, and makes the notes that the overlays need.

    Parameters
    ----------
    request : Request
        Which overlays are wanted.
    simulations : sequence of Simulation
        All of one scene; they share their scales.
    frames : int
        Number of frames that there will be.
    rate : float
        Frames in a second of the scene's time.
    """

    def __init__(
        self, request: Request, simulations: Sequence[Simulation], frames: int, rate: float
    ) -> None:
        self._request = request
        self._simulations = simulations
        self._dt = 1 / rate  # from frame to frame [s]
        ripples = simulations[0].ripples
        if request.heatmap == "velocity":
            # wave speed [m/s]
            size = max(float(np.max(ripples[name].material.speed)) for name in ripples)
        else:
            # edge of the bounding box [m]
            size = max(float(np.ptp(ripples[name].atlas.mesh.V, axis=0).max()) for name in ripples)
        self._heatmap_limit = Limit(_MIN_HEATMAP_LIMIT * size, request.limit, _HEATMAP_MEMORY)
        self._mark_limit = Limit()
        self._energy_limit = Limit()
        self._marks = [ContactMarks(simulation, self._dt) for simulation in simulations]
        self._energies = np.zeros((len(simulations), frames))  # of the waves [J]
        self._frames_followed = 0

    def follow(self) -> Notes:
        """Take in the present frame of the simulations; call it for each frame, rendered or not."""
        request = self._request
        heatmaps = []
        if request.heatmap:
            for simulation in self._simulations:
                heatmaps.append(_fields(simulation.ripples, request.heatmap))
        marks = [gatherer.follow() for gatherer in self._marks] if request.contacts else []
        ledgers = [simulation.energy for simulation in self._simulations] if request.energy else []
        if ledgers:
            self._energies[:, self._frames_followed] = [ledger.waves for ledger in ledgers]
            self._frames_followed += 1
        curves = self._energy_curves()
        fields = itertools.chain.from_iterable(heatmap.values() for heatmap in heatmaps)
        magnitudes = [magnitude(field) for field in fields]
        impulses = [mark.impulse for mark in itertools.chain.from_iterable(marks)]
        latest_energies = [energies[-1] for _, energies in curves if len(energies)]
        return Notes(
            time=float(self._simulations[0].data.time),
            heatmaps=heatmaps,
            heatmap_scale=self._scale(self._heatmap_limit, magnitudes),
            marks=marks,
            mark_scale=self._scale(self._mark_limit, impulses),
            energies=curves,
            energy_scale=self._scale(self._energy_limit, latest_energies),
            ledgers=ledgers,
            traces=traces(self._simulations[0].sensors) if request.sensors else [],
        )

    def _energy_curves(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Times [s] and energies of the waves [J] of each run so far."""
        curves = []
        for energies in self._energies:
            frame_numbers, values = curve(energies[: self._frames_followed], len(energies))
            curves.append((frame_numbers * self._dt, values))
        return curves

    def _scale(self, limit: Limit, magnitudes: Sequence[float]) -> Scale:
        return limit.follow(max(magnitudes, default=0.0), self._dt), limit.goal


def _fields(ripples: Ripples, kind: str) -> dict[str, NDArray[np.float32]]:
    """The "height" or the "velocity" of each target, with halo."""
    fields = {}
    for name in ripples:
        waves = ripples[name]
        fields[name] = with_filled_halo(waves.atlas.texels.topology, getattr(waves, kind))
    return fields
