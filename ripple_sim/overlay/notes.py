"""The content of the overlays, gathered from running simulations frame by frame.

`Notebook` follows one simulation, or two of one scene side by side, and notes for each frame what
is to be shown: fields for heatmaps, marks of contacts, energies so far, and the ends of their
scales, round numbers that are steady.

The colour map of heatmaps is blue for negative, almost white for zero, red for positive values: a
curve in CIELAB of constant speed, so that equal steps of the value look equally large. Both arms
have the same lightness at the same distance from zero, and blue differs from orange-red in every
common colour vision.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.energy import Energy
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError
from ripple_sim.render.tone_mapping import linear_to_srgb
from ripple_sim.scene.overlays import Request
from ripple_sim.simulation import Simulation
from ripple_sim.solver.texels.halo import with_filled_halo
from ripple_sim.solver.waves.sensor import UNITS, Sensor

from .marks import ContactMarks, Mark

SIZE = 513  # odd: zero has a colour of its own

# lightness, chroma at equal distances from zero; hues of the two arms [degrees]
_ARM = np.array([(96.0, 0.0), (85.0, 19.0), (70.0, 39.0), (53.0, 49.0), (34.0, 45.0)])
# near zero, at the end
_BLUE = (245.0, 285.0)
_RED = (62.0, 30.0)

_WHITE = np.array([0.95047, 1.0, 1.08883])  # D65
_XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)

OWN = "fem"

# By wave operator: a title, and a remark.
TITLES = {
    OWN: ("ripple-sim", "finite elements"),
    "paper": ("paper", "real distances, 4 neighbours"),
    "uncorrected": ("uncorrected", "one distance everywhere"),
    "dynamic-paint": ("Dynamic Paint", "real distances, 8 neighbours"),
}
BASELINES = tuple(name for name in TITLES if name != OWN)
COLUMNS = 512  # of a trace
MOST_POINTS = 1024  # more than the energy plot has columns of pixels, save on very large frames
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)  # halves of these are short numbers too
_EASE = 0.12  # time in which a limit covers most of the way to its new value [s]
_FAR = 4.0  # a limit that is more than this factor away catches up at once

# The colours end at this share of the targets' size, or of their wave speed, until higher waves
# come.
_LEAST = 1e-3

# A contact's first dent is much deeper than its waves, but brief [s].
_MEMORY = 0.25


@functools.lru_cache(maxsize=1)
def color_table() -> NDArray[np.uint8]:
    """Return the colours, sRGB uint8 [SIZE, 3], from the most negative to the most positive value."""
    negative, positive = (_arm(*hues) for hues in (_BLUE, _RED))
    lab = np.concatenate([negative[::-1], positive[1:]])
    table = np.rint(255 * np.clip(lab_to_srgb(lab), 0, 1)).astype(np.uint8)
    table.setflags(write=False)
    return table


def colors(values: ArrayLike, limit: float) -> NDArray[np.uint8]:
    """Colours of values, sRGB uint8 [..., 3]; the map extends from -limit to limit, and values beyond are clipped."""
    place = np.clip(np.asarray(values, dtype=np.float64) / limit, -1, 1)
    return color_table()[np.rint((0.5 + 0.5 * place) * (SIZE - 1)).astype(np.int64)]


def lab_to_srgb(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """SRGB values (IEC 61966-2-1) of CIELAB colours under D65, [..., 3]; outside of 0 to 1 where sRGB has none."""
    f = (lab[..., :1] + 16) / 116 + np.stack(
        [lab[..., 1] / 500, np.zeros(lab.shape[:-1]), -lab[..., 2] / 200], axis=-1
    )
    xyz = _WHITE * np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    return linear_to_srgb(xyz @ _XYZ_TO_RGB.T)


def _arm(hue_near: float, hue_end: float) -> NDArray[np.float64]:
    """CIELAB colours from zero to an end, through the control points, [SIZE // 2 + 1, 3]."""
    place = np.linspace(0, 1, 1025)
    knots = np.linspace(0, 1, len(_ARM))
    lightness, chroma = (
        np.polyval(np.polyfit(knots, column, len(knots) - 1), place) for column in _ARM.T
    )
    hue = np.radians(hue_near + (hue_end - hue_near) * place)
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=1)
    # points of that curve at equal differences of colour (CIE 1976)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lab, axis=0), axis=1))])
    even = np.linspace(0, length[-1], SIZE // 2 + 1)
    return np.stack([np.interp(even, length, column) for column in lab.T], axis=1)


def compared_operators(baseline: str | None) -> tuple[str, ...]:
    """Wave operators of the runs of a video: our own, and a baseline if given.

    Raises `SceneError` for an unknown baseline.
    """
    if baseline is None:
        return (OWN,)
    if baseline not in BASELINES:
        raise SceneError(
            f"there is no operator {baseline!r} to compare with; valid are {', '.join(BASELINES)}"
        )
    return OWN, baseline


def magnitude(field: NDArray[np.float32]) -> float:
    """Mean magnitude of a field with halo, weighted by the magnitude itself: how high the waves are.

    The calm surface around a small wave does not count, and the few texels in the dent under a
    contact count little.
    """
    inside = np.abs(field[:, 1:-1, 1:-1]).ravel()
    total = float(inside.sum(dtype=np.float64))
    return float(np.dot(inside, inside)) / total if total else 0.0


def grid_spacing(resolution: int) -> int:
    """Texels between grid lines: a power of two that leaves 16 to 31 cells along a chart, or one texel per cell."""
    return 1 << max(0, (resolution // 16).bit_length() - 1)


def curve(
    values: NDArray[np.float64], frames: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frame numbers and values of a curve of a value a frame so far, of so many frames in all.

    It has at most `MOST_POINTS`: of several frames the largest value is kept.
    """
    begins = np.arange(0, len(values), -(-frames // MOST_POINTS))
    return begins.astype(np.float64), np.maximum.reduceat(values, begins) if len(
        values
    ) else np.zeros(0)


def round_up(value: float, steps: tuple[float, ...] = _STEPS) -> float:
    """Return the smallest of `steps` times a power of ten that is at least a positive value."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return next(
        (step * power for step in steps if value <= step * power * (1 + 1e-9)), 10.0 * power
    )


class Limit:
    """End of a scale that follows the magnitudes so far and never shrinks.

    Its goals are round numbers, so it seldom moves, and it glides from one to the next. It depends
    on the magnitudes alone: the same run has the same limits.

    Parameters
    ----------
    floor : float
        The least limit. 0: the first positive magnitude sets it.
    fixed : float, optional
        The limit, for good.
    memory : float
        Magnitudes are averaged over about this time [s], so that brief peaks do not count. 0: each
        counts.
    """

    def __init__(self, floor: float = 0.0, fixed: float | None = None, memory: float = 0.0) -> None:
        self._fixed = fixed is not None
        self._memory = memory
        self._mean = 0.0
        self.goal = fixed if fixed is not None else round_up(floor) if floor > 0 else 0.0
        self.value = self.goal

    def follow(self, magnitude: float, dt: float) -> float:
        """Take in a magnitude, dt seconds after the last one; return the limit, 0 while there is none."""
        if self._fixed:
            return self.value
        self._mean += (magnitude - self._mean) * (
            -math.expm1(-dt / self._memory) if self._memory else 1.0
        )
        if self._mean > self.goal:
            self.goal = round_up(self._mean)
        self.value = max(self.value, self.goal / _FAR) if self.value else self.goal
        if self.value >= 0.995 * self.goal:
            self.value = self.goal
        else:
            self.value *= (self.goal / self.value) ** -math.expm1(-dt / _EASE)
        return self.value


def readable(limit: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which a limit is a number from 1 to 1000, such as (1e3, "mm") for 0.02 and "m"."""
    power = min(9, max(-9, 3 * math.floor(math.log10(limit * (1 + 1e-9)) / 3)))
    return 10.0**-power, _PREFIXES[power] + unit


def number(value: float) -> str:
    """Format a number briefly, with a true minus sign."""
    text = f"{value:.4g}"
    return "0" if text == "-0" else text.replace("-", "\N{MINUS SIGN}")


Trace: TypeAlias = tuple[str, NDArray[np.float64], NDArray[np.float32], NDArray[np.float32], str]
Scale: TypeAlias = tuple[float, float]  # its present end, and the round number that this approaches


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
        Of the waves, from the beginning.
    ledgers : sequence of Energy
        Of bodies, waves and both, now.
    traces : sequence of (name, times [s], least, greatest, unit)
        Of the first point of each sensor of the first run: one value a column, over the time so
        far.
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
    """The signals of sensors so far: least and greatest value in `COLUMNS` stretches of equal length, or fewer."""
    made = []
    for name, sensor in sensors.items():
        values = sensor.samples[:, 0]
        begins = np.arange(0, len(values), max(1, -(-len(values) // COLUMNS)))
        low, high = (
            each.reduceat(values, begins) if len(values) else values
            for each in (np.minimum, np.maximum)
        )
        made.append((name, sensor.times[begins], low, high, UNITS[sensor.kind]))
    return made


class Notebook:
    """Follows simulations that run in step, as far as the requested overlays need it.

    Parameters
    ----------
    simulations : sequence of Simulation
        All of one scene; they share their scales.
    frames : int
        How many there will be.
    rate : float
        Frames in a second of the scene's time.
    """

    def __init__(
        self, request: Request, simulations: Sequence[Simulation], frames: int, rate: float
    ) -> None:
        self._request = request
        self._simulations = simulations
        self._dt = 1 / rate
        ripples = simulations[0].ripples
        if request.heatmap == "velocity":
            size = max(float(np.max(ripples[name].material.speed)) for name in ripples)
        else:
            size = max(float(np.ptp(ripples[name].atlas.mesh.V, axis=0).max()) for name in ripples)
        self._heatmap_limit = Limit(_LEAST * size, request.limit, _MEMORY)
        self._mark_limit = Limit()
        self._energy_limit = Limit()
        self._marks = [ContactMarks(simulation, self._dt) for simulation in simulations]
        self._energies = np.zeros((len(simulations), frames))
        self._followed = 0

    def follow(self) -> Notes:
        """Take in the simulations' present frame. Call it for every frame, rendered or not."""
        request = self._request
        heatmaps = [
            self._heatmaps(each.ripples, request.heatmap)
            for each in self._simulations
            if request.heatmap
        ]
        marks = [gatherer.follow() for gatherer in self._marks] if request.contacts else []
        ledgers = [simulation.energy for simulation in self._simulations] if request.energy else []
        if ledgers:
            self._energies[:, self._followed] = [ledger.waves for ledger in ledgers]
            self._followed += 1
        magnitudes = [magnitude(heatmap) for run in heatmaps for heatmap in run.values()]
        curves = [curve(energies[: self._followed], len(energies)) for energies in self._energies]
        return Notes(
            time=float(self._simulations[0].data.time),
            heatmaps=heatmaps,
            heatmap_scale=self._scale(self._heatmap_limit, magnitudes),
            marks=marks,
            mark_scale=self._scale(
                self._mark_limit, [mark.impulse for run in marks for mark in run]
            ),
            energies=[(frames * self._dt, values) for frames, values in curves],
            energy_scale=self._scale(
                self._energy_limit, [values[-1] for _, values in curves if len(values)]
            ),
            ledgers=ledgers,
            traces=traces(self._simulations[0].sensors) if request.sensors else [],
        )

    def _scale(self, limit: Limit, magnitudes: Sequence[float]) -> Scale:
        return limit.follow(max(magnitudes, default=0.0), self._dt), limit.goal

    def _heatmaps(self, ripples: Ripples, shown: str) -> dict[str, NDArray[np.float32]]:
        each = {name: ripples[name] for name in ripples}
        return {
            name: with_filled_halo(on.atlas.texels.topology, getattr(on, shown))
            for name, on in each.items()
        }
