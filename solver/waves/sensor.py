"""Sensors: the samples of an accelerometer, a contact microphone or a strain gauge on a surface.

Each point of a sensor has a weighted sum of the texels round it after every substep, see `Probes`.
A low-pass filter gives samples at the sensor's own rate from these sums, at exact times: a sample
does not depend on when it is read.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..backends.backend import Backend
from ..backends.probes import Probes
from ..errors import POSITIVE, SolverError, shown
from ..kernel import Floats, Ints, kernel
from ..operator.material import Material, frequency
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas
from ..texels.topology import TexelTopology

UNITS = {"acceleration": "m/s^2", "velocity": "m/s", "height": "m", "strain": "1"}
KINDS = tuple(UNITS)

_MIN_WAVE_TEXELS = 5.0  # texels along the shortest wave that a sensor measures honestly

# The filter lets through frequencies below _PASSED_SHARE of the rate, and nothing from half the
# rate on.
_FILTER_REACH = 16  # half the filter's length [samples]
_ATTENUATION = 80.0  # [dB]
_TABULATED = 512  # tabulated values of the filter for each sample
_HALVED_SHARE = 0.42  # frequency that the filter halves, as a share of the rate
_PASSED_SHARE = 0.34

# A texel and the four beside it.
_TEXELS_IN_CROSS = 5

# Singular values of a fit below this share of the largest one count as 0.
_FIT_CUTOFF = 1e-6


class Listener(Protocol):
    """Hears the sums of its `Probes` after every substep.

    `begin` gets the sums at a time [s], [k]; `take` gets the sums of the substeps of dt [s] from a
    time [s] on, [substeps, k].
    """

    probes: Probes

    def begin(self, time: float, values: NDArray) -> None: ...  # noqa: D102
    def take(self, time: float, dt: float, sums: NDArray[np.float32]) -> None: ...  # noqa: D102


Heard = TypeVar("Heard", bound=Listener)


class Listeners:
    """All that listens to a solver.

    Attributes
    ----------
    all : tuple of Listener
        See `use`.
    find_points : callable or None
        Gives the points [k, 3] of a name for `WaveSolver.sensor`; None if names are not known.
    """

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self.all: tuple[Listener, ...] = ()
        self.find_points: Callable[[str], ArrayLike] | None = None

    def use(self, listeners: Sequence[Listener]) -> None:
        """Replace all listeners.

        They continue as they are, also listeners of another solver of the surface.
        """
        self.all = tuple(listeners)
        probes = [listener.probes for listener in listeners]
        self._backend.probe(Probes.together(probes) if probes else None)

    def add(self, listener: Heard, time: float) -> Heard:
        """Add a listener that listens from a time [s] on."""
        self.use([*self.all, listener])
        self._begin(listener, time)
        return listener

    def begin(self, time: float) -> None:
        """Restart all listeners."""
        for listener in self.all:
            self._begin(listener, time)

    def hear(self, time: float, dt: float) -> None:
        """Give each listener its sums of the latest substeps, of dt [s] from a time [s] on."""
        sums = self._backend.probed()
        end = 0
        for listener in self.all:
            begin = end
            end = end + len(listener.probes.heights)
            listener.take(time, dt, sums[:, begin:end])

    def _begin(self, listener: Listener, time: float) -> None:
        height = self._backend.fields.height()
        listener.begin(time, listener.probes.of(height, self._backend.velocity()))


class Samples(NamedTuple):
    """Times [k] [s], and what a sensor measured then, float32 [k, points]."""

    times: NDArray[np.float64]
    values: NDArray[np.float32]


def check_sensor(kind: object, rate: object, thickness: object) -> None:
    """Raise `SolverError` if a sensor's kind, rate or thickness is invalid, see `Sensor`."""
    if kind not in KINDS:
        raise SolverError(
            f"sensor kind must be one of {', '.join(map(repr, KINDS))}, got {shown(kind)}"
        )
    if not POSITIVE.holds(rate):
        raise SolverError(
            f"sensor rate must be {POSITIVE.words}, in samples a second, got {shown(rate)}"
        )
    needs_thickness = kind == "strain"
    has_thickness = thickness is not None
    valid_thickness = thickness is None or POSITIVE.holds(thickness)
    if needs_thickness != has_thickness or not valid_thickness:
        raise SolverError(
            f"sensor thickness must be {POSITIVE.words} for kind 'strain' (the thickness of "
            f"the bent sheet), and None for other kinds, got {shown(thickness)} m"
        )


class Sensor:
    """Measures a surface at some points from now on, along its normal; made by `WaveSolver.sensor`.

    `times` and `samples` are the samples that have not been read yet; `read` returns and removes
    them. Samples of the last `latency` are missing: the filter needs the heights after them. The
    kind "strain" is the strain of the outer face of a thin sheet that the waves bend: -thickness /
    4 times the Laplacian of the height, the mean over all directions, positive where the face is
    longer.

    Attributes
    ----------
    points : float64 [k, 3]
        On the surface when the sensor was made [m]; they move with the surface.
    kind : str
    rate : float
        Samples a second [1/s].
    bandwidth : float
        Highest honest frequency [Hz]: the frequency of a wave of five texels, where the texels are
        largest among all points, but at most a third of the rate and of the substeps' rate.

    Raises
    ------
    SolverError
        For an unknown kind, a rate that is not greater than 0, or a thickness without strain or the
        other way round.
    AtlasError
        If the points are not finite, or of another shape.
    """

    def __init__(
        self,
        atlas: Atlas,
        material: Material,
        operator: WaveOperator,
        points: ArrayLike,
        kind: str,
        rate: float,
        thickness: float | None,
    ) -> None:
        check_sensor(kind, rate, thickness)
        self.points, centers = atlas.nearest(points)
        self.kind = kind
        self.rate = float(rate)
        laplacian = -thickness / 4 if thickness is not None else None
        texels = []
        weights = []
        for point, center in zip(self.points, centers, strict=True):
            point_texels, point_weights = _row(atlas, point, int(center), laplacian)
            texels.append(point_texels)
            weights.append(point_weights)
        self.probes = Probes(
            begins=np.append(0, np.cumsum([len(point_texels) for point_texels in texels])),
            texels=np.concatenate(texels),
            weights=np.concatenate(weights).astype(np.float32),
            heights=np.full(len(texels), kind in ("height", "strain")),
        )
        # where substeps are longer than samples there is nothing between substeps to filter out
        self._base = min(self.rate, 1 / operator.longest_timestep)
        self.bandwidth = trusted_frequency(atlas, material, centers, self._base)
        self.begin(0.0, np.zeros(len(texels)))

    @property
    def latency(self) -> float:
        """Time from a sample until it can be read [s]."""
        return _FILTER_REACH / self._base

    @property
    def time(self) -> float:
        """The time of the waves up to which the sensor has measured [s]."""
        return self._latest

    def begin(self, time: float, values: NDArray) -> None:
        """Restart at a time [s], with the sums of the probes at that time."""
        self._start = time
        self._latest = time
        self._next = 0
        self._last = np.asarray(values, np.float64)
        self._heard: list[tuple[float, float, NDArray]] = []
        # times [s], spans [s] and values that later samples need
        self._kept = np.zeros(0), np.zeros(0), np.zeros((0, len(values)))
        self._unread = Samples(np.zeros(0), np.zeros((0, len(values)), np.float32))

    def take(self, time: float, dt: float, sums: NDArray[np.float32]) -> None:
        """Take in the sums of substeps of dt [s] from a time [s] on, [substeps, k]."""
        self._heard.append((time, dt, sums))
        self._latest = time + dt * len(sums)

    def read(self) -> Samples:
        """The times and samples since the last `read`."""
        self._make()
        unread = self._unread
        self._unread = Samples(unread.times[:0], unread.values[:0])
        return unread

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of `samples` [s], [k].

        They are whole periods of the rate after the sensor was made, or the waves were reset.
        """
        self._make()
        return self._unread.times

    @property
    def samples(self) -> NDArray[np.float32]:
        """Samples not read yet [m/s^2, m/s, m, or 1 for strain], float32 [k, points]."""
        self._make()
        return self._unread.values

    def _make(self) -> None:
        """Compute the samples that can be known by now, and forget what no later sample needs."""
        until = int(np.floor((self._latest - self.latency - self._start) * self.rate * (1 + 1e-12)))
        if until < self._next:
            return
        times, spans, values = self._take_heard()
        kept_times, kept_spans, kept_values = self._kept
        times = np.concatenate([kept_times, times])
        spans = np.concatenate([kept_spans, spans])
        values = np.concatenate([kept_values, values])
        sample_times = self._start + np.arange(self._next, until + 1) / self.rate
        samples = filtered(times, spans, values, sample_times, self._base).astype(np.float32)
        self._unread = Samples(
            np.append(self._unread.times, sample_times),
            np.concatenate([self._unread.values, samples]),
        )
        self._next = until + 1
        next_time = self._start + self._next / self.rate
        first_kept = np.searchsorted(times, next_time - self.latency)
        self._kept = times[first_kept:], spans[first_kept:], values[first_kept:]

    def _take_heard(self) -> tuple[NDArray, NDArray, NDArray]:
        """Times [m] [s], spans [m] [s] and values [m, points] since the last call.

        Values are the sums that were heard, or their rates if accelerations are measured.
        """
        spans = np.concatenate([np.full(len(sums), dt) for _, dt, sums in self._heard])
        times = np.concatenate(
            [time + dt * np.arange(1, len(sums) + 1) for time, dt, sums in self._heard]
        )
        values = np.concatenate([sums for *_, sums in self._heard]).astype(np.float64)
        self._heard.clear()
        last = self._last
        self._last = values[-1]
        if self.kind == "acceleration":  # accelerations lie between two substeps
            times = times - spans / 2
            values = np.diff(values, axis=0, prepend=last[None]) / spans[:, None]
        elif self._next == 0:
            times = np.append(self._start, times)
            spans = np.append(spans[:1], spans)
            values = np.concatenate([last[None], values])
        return times, spans, values


def filtered(
    times: NDArray, spans: NDArray, values: NDArray, at: NDArray, rate: float
) -> NDArray[np.float64]:
    """Pass values [m, points] through the low pass of `_filter`, for other times [k].

    Each value holds for a span [s] round its time. The result is the sum over the filter's length
    of filter times span times value, divided by the sum of filter times span. So a constant stays
    the same, also where the length of the substeps changes.
    """
    reach = _FILTER_REACH / rate
    first = np.searchsorted(times, at - reach)
    last = np.searchsorted(times, at + reach)
    result = np.zeros((len(at), values.shape[1]))
    filter_values = Filter(*_filter(), rate * _TABULATED)
    _filter_values(Signal(times, spans, values), at, filter_values, first, last, result)
    return result


class Signal(NamedTuple):
    """Values [m, points] that hold for spans [s], [m], round times [s], [m]."""

    times: Floats
    spans: Floats
    values: Floats


class Filter(NamedTuple):
    """The filter's values from its middle on, the steps between them, and values a second."""

    taps: Floats
    slopes: Floats
    rate: float


@kernel
def _filter_values(
    signal: Signal, at: Floats, low_pass: Filter, first: Ints, last: Ints, result: Floats
) -> None:
    """Filter the values `first` to `last` for each time in `at`; see `filtered`.

    Stiff plates have hundreds of substeps in a sample: the weights of a second of sound are a
    hundred million, which NumPy would write to memory ten times.
    """
    end = len(low_pass.taps) - 1
    for i in range(len(at)):
        total = 0.0
        for j in range(first[i], last[i]):
            # how far the value is from the middle of the filter, in steps of its table
            steps = min(abs(signal.times[j] - at[i]) * low_pass.rate, float(end))
            index = int(steps)
            tap = low_pass.taps[index] + low_pass.slopes[index] * (steps - index)
            weight = tap * signal.spans[j]
            total += weight
            for point in range(result.shape[1]):
                result[i, point] += weight * signal.values[j, point]
        for point in range(result.shape[1]):
            result[i, point] /= total


@functools.cache
def _filter() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The filter's values from its middle on, `_TABULATED` a sample, and the steps between them.

    The filter is a windowed sinc.
    """
    # imported here: it takes a third of the import time of a program that has no sensor
    from scipy.signal import firwin, kaiser_beta

    window = "kaiser", kaiser_beta(_ATTENUATION)
    middle = _FILTER_REACH * _TABULATED
    filter_values = firwin(2 * middle + 1, 2 * _HALVED_SHARE / _TABULATED, window=window)
    taps = filter_values[middle:]
    return taps, np.append(np.diff(taps), 0.0)


def _around(topology: TexelTopology, center: int, rings: int) -> NDArray[np.int64]:
    """The texels of some rings round one."""
    texels = np.array([center])
    for _ in range(rings):
        chart, row, column = np.unravel_index(texels, topology.shape)
        rows = row[:, None] + np.arange(3)
        columns = column[:, None] + np.arange(3)
        square = topology.halo[chart[:, None, None], rows[:, :, None], columns[:, None, :]]
        texels = np.unique(np.append(texels, square[square >= 0]))
    return texels


class _Fit(NamedTuple):
    """Moving least squares (Lancaster and Salkauskas 1981) in the tangent plane.

    Near texels count most.

    Attributes
    ----------
    degree : int
        Of the polynomial.
    rings : int
        Rings of texels that are fitted.
    softening, power : float
        The weight at a distance r, in texels, is 1 / (r^2 + softening)^power.
    growth : float
        A term of order i has the cost growth^-i. Where there are too few texels for all terms, as
        beside rims, 0.1 prefers terms of a low order.
    """

    degree: int
    rings: int
    softening: float
    power: float
    growth: float


# Fits of the value at a point, and of the second derivatives there. At five texels a wave the
# second derivatives of a quartic are 0.7 dB too low, those of a cubic 4 dB.
_VALUE = _Fit(degree=3, rings=2, softening=1e-3, power=1.0, growth=1.0)
_CURVATURE = _Fit(degree=4, rings=3, softening=0.1, power=2.0, growth=0.1)


def _row(
    atlas: Atlas, point: NDArray, center: int, laplacian: float | None
) -> tuple[NDArray, NDArray]:
    """Texels round a point, and the weights that give the value of a field at the point.

    With a factor `laplacian`, they give this factor times the field's Laplacian [1/m^2]. The
    weights are those of a polynomial that fits the texels, see `_Fit`, also across the borders of
    charts.
    """
    fit = _VALUE if laplacian is None else _CURVATURE
    texels = _around(atlas.texels.topology, center, fit.rings)
    away = atlas.positions.reshape(-1, 3)[texels] - point
    normal = atlas.normals.reshape(-1, 3)[center]
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    size = np.sqrt(atlas.areas.reshape(-1)[center])
    x = away @ u / size
    y = away @ v / size
    near = 1 / (x * x + y * y + fit.softening) ** fit.power
    # exponents of x and y in the terms of the polynomial
    orders = []
    for i in range(fit.degree + 1):
        for j in range(fit.degree + 1 - i):
            orders.append((i, j))
    growth = np.array([fit.growth ** (i + j) for i, j in orders])
    powers = np.stack([x**i * y**j for i, j in orders], axis=1)
    inverse = np.linalg.pinv(near[:, None] * powers * growth, rcond=_FIT_CUTOFF)
    solved = growth[:, None] * inverse * near
    if laplacian is None:
        return texels, solved[0]
    second_derivatives = solved[orders.index((0, 2))] + solved[orders.index((2, 0))]
    return texels, laplacian * 2 * second_derivatives / size**2


def trusted_frequency(
    atlas: Atlas, material: Material, centers: Iterable[int], rate: float
) -> float:
    """Frequency [Hz] up to which samples are right, taken at a rate [1/s] round given texels.

    The texels carry the waves up to there, and the filter passes them.
    """
    resolved = (_resolved(atlas, material, int(center)) for center in centers)
    return min(*resolved, _PASSED_SHARE * rate)


def _resolved(atlas: Atlas, material: Material, center: int) -> float:
    """Frequency [Hz] of the shortest wave that the texels round a texel carry."""
    texels = _around(atlas.texels.topology, center, 1)
    away = np.linalg.norm(
        atlas.positions.reshape(-1, 3)[texels] - atlas.positions.reshape(-1, 3)[center], axis=1
    )
    nearest = np.sort(away)[:_TEXELS_IN_CROSS]
    widest = nearest.max()
    return hertz(material, center, _MIN_WAVE_TEXELS * widest)


def hertz(material: Material, texel: int, length: float) -> float:
    """Frequency [Hz] of a wave of a length [m], of the material at a texel with a flat index."""
    local = {}
    for name, value in vars(material).items():
        is_map = np.ndim(value) > 0 and name != "wavelengths"
        local[name] = np.asarray(value).reshape(-1)[texel] if is_map else value
    return frequency(Material(**local), 2 * np.pi / length) / (2 * np.pi)
