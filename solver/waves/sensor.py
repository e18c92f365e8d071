"""Sensors: what an accelerometer, a contact microphone or a strain gauge on a rippling surface gives, as samples.

A sensor's points see a weighted sum of the texels round them after every substep, see `Probes`. The
samples at its own rate come from a low-pass filter, evaluated at their exact times: those that are
there do not depend on when they are read.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..backends.backend import Backend
from ..backends.kernels import Probes
from ..errors import POSITIVE, SolverError, shown
from ..operator.material import Material, frequency
from ..operator.wave_operator import WaveOperator
from ..texels.atlas import Atlas, check_points
from ..texels.topology import TexelTopology

UNITS = {"acceleration": "m/s^2", "velocity": "m/s", "height": "m", "strain": "1"}
KINDS = tuple(UNITS)

# Texels along the shortest wave that a sensor is honest about.
_TEXELS = 5.0

# The filter: half its length in samples, its attenuation [dB], values tabulated a sample, and where
# it has fallen by half, over the rate. It lets through what is below _PASSED of the rate, and
# nothing from a half of it on.
_HALF = 16
_ATTENUATION = 80.0
_FINE = 512
_CUT = 0.42
_PASSED = 0.34

# Samples that are made together: their weights take some MB.
_TOGETHER = 4096


class Listener(Protocol):
    """Hears the sums of its `Probes` after every substep: begins with those at a time, and takes in those of a step."""

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
        From a name to the points [k, 3] that `WaveSolver.sensor` takes for it; None: names are not
        known.
    """

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self.all: tuple[Listener, ...] = ()
        self.find_points: Callable[[str], ArrayLike] | None = None

    def use(self, listeners: Sequence[Listener]) -> None:
        """Listen with these alone from now on; they go on as they are, also those of another solver of the surface."""
        self.all = tuple(listeners)
        self._backend.probe(
            Probes.together([each.probes for each in listeners]) if listeners else None
        )

    def add(self, listener: Heard, time: float) -> Heard:
        """Listen from a time [s] on, beside those that do."""
        self.use([*self.all, listener])
        self._begin(listener, time)
        return listener

    def begin(self, time: float) -> None:
        """All begin anew."""
        for each in self.all:
            self._begin(each, time)

    def hear(self, time: float, dt: float) -> None:
        """Hand each its own sums of the latest substeps, of dt [s] from a time on."""
        sums = self._backend.probed()
        end = 0
        for listener in self.all:
            begin = end
            end = end + len(listener.probes.heights)
            listener.take(time, dt, sums[:, begin:end])

    def _begin(self, listener: Listener, time: float) -> None:
        listener.begin(time, listener.probes.of(self._backend.height(), self._backend.velocity()))


class Samples(NamedTuple):
    """Times [k] [s], and what a sensor measured then, float32 [k, points]."""

    times: NDArray[np.float64]
    values: NDArray[np.float32]


class Sensor:
    """Measures a surface at some points from now on, along its normal; made by `WaveSolver.sensor`.

    `times` and `samples` are all that have not been read yet, and `read` takes them away. The last
    `latency` is not among them: the filter needs what comes after. A kind "strain" is that of the
    outer face of a thin sheet that the waves bend, -thickness / 4 times the Laplacian of the
    height: the mean over all directions, positive where longer.

    Attributes
    ----------
    points : float64 [k, 3]
        On the surface where it was when the sensor was made [m]; they ride along.
    kind : str
    rate : float
        Samples a second [1/s].
    bandwidth : float
        Highest honest frequency [Hz]: that of a wave of five texels where these are the largest, of
        all points, but no more than a third of the rate, or of the substeps' rate.

    Raises
    ------
    SolverError
        For an unknown kind, a rate that is not greater than 0, or a thickness without strain or the
        other way round.
    AtlasError
        If the points are not finite, or of another shape.
    """

    def __init__(
        self, atlas: Atlas, material: Material, operator: WaveOperator, points: ArrayLike,
        kind: str, rate: float, thickness: float | None,
    ) -> None:  # fmt: skip
        if kind not in KINDS:
            raise SolverError(
                f"sensor kind is {shown(kind)}; valid are {', '.join(map(repr, KINDS))}"
            )
        if not POSITIVE.holds(rate):
            raise SolverError(
                f"sensor rate is {shown(rate)}; valid is {POSITIVE.words}, in samples a second"
            )
        if (kind == "strain") != (thickness is not None) or not (
            thickness is None or POSITIVE.holds(thickness)
        ):
            raise SolverError(
                f"sensor thickness is {shown(thickness)} m; valid is {POSITIVE.words} for kind "
                f"'strain', that of the "
                "sheet that is bent, and none for the others"
            )
        self.points, centers = atlas.nearest(check_points(points))
        self.kind = kind
        self.rate = float(rate)
        laplacian = -thickness / 4 if thickness is not None else None
        rows = (
            _row(atlas, point, int(center), laplacian)
            for point, center in zip(self.points, centers, strict=True)
        )
        texels, weights = zip(*rows, strict=True)
        begins = np.append(0, np.cumsum([len(each) for each in texels]))
        of_heights = np.full(len(texels), kind in ("height", "strain"))
        self.probes = Probes(
            begins, np.concatenate(texels), np.concatenate(weights).astype(np.float32), of_heights
        )
        # where substeps are longer than samples there is nothing between them to filter out
        self._base = min(self.rate, 1 / operator.longest_timestep)
        shortest = (_resolved(atlas, material, int(center)) for center in centers)
        self.bandwidth = min(*shortest, _PASSED * self._base)
        self.begin(0.0, np.zeros(len(texels)))

    @property
    def latency(self) -> float:
        """Time from a sample until it is there [s]."""
        return _HALF / self._base

    def begin(self, time: float, values: NDArray) -> None:
        """Begin anew at a time [s], with the sums of the probes then."""
        self._start = self._latest = time
        self._next = 0
        self._last = np.asarray(values, np.float64)
        self._heard: list[tuple[float, float, NDArray]] = []
        # times, spans and values that later samples need
        self._kept = np.zeros(0), np.zeros(0), np.zeros((0, len(values)))
        self._made = Samples(np.zeros(0), np.zeros((0, len(values)), np.float32))

    def take(self, time: float, dt: float, sums: NDArray[np.float32]) -> None:
        """Take in the sums of substeps of dt [s] from a time on, [substeps, k]."""
        self._heard.append((time, dt, sums))
        self._latest = time + dt * len(sums)

    def read(self) -> Samples:
        """The times and samples since the last `read`."""
        self._make()
        made = self._made
        self._made = Samples(made.times[:0], made.values[:0])
        return made

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of `samples` [s], [k]: whole periods of the rate after the sensor was made, or the waves reset."""
        self._make()
        return self._made.times

    @property
    def samples(self) -> NDArray[np.float32]:
        """What was measured and not read yet [m/s^2, m/s, m, or 1 for strain], float32 [k, points]."""
        self._make()
        return self._made.values

    def _make(self) -> None:
        """Make the samples whose surroundings are known, and forget what no later one needs."""
        until = int(np.floor((self._latest - self.latency - self._start) * self.rate * (1 + 1e-12)))
        if until < self._next:
            return
        # all that is kept and was heard: times, their spans, and values
        spans = np.concatenate([np.full(len(sums), dt) for _, dt, sums in self._heard])
        times = np.concatenate(
            [time + dt * np.arange(1, len(sums) + 1) for time, dt, sums in self._heard]
        )
        values = np.concatenate([sums for *_, sums in self._heard]).astype(np.float64)
        self._heard.clear()
        last = self._last
        self._last = values[-1]
        if self.kind == "acceleration":  # they lie between two substeps
            times = times - spans / 2
            values = np.diff(values, axis=0, prepend=last[None]) / spans[:, None]
        elif self._next == 0:
            times = np.append(self._start, times)
            spans = np.append(spans[:1], spans)
            values = np.concatenate([last[None], values])
        known = zip(self._kept, (times, spans, values), strict=True)
        times, spans, values = (np.concatenate(each) for each in known)
        at = self._start + np.arange(self._next, until + 1) / self.rate
        blocks = [at[i : i + _TOGETHER] for i in range(0, len(at), _TOGETHER)]
        made = [
            filtered(times, spans, values, block, self._base).astype(np.float32) for block in blocks
        ]
        self._made = Samples(
            np.append(self._made.times, at), np.concatenate([self._made.values, *made])
        )
        self._next = until + 1
        kept = np.searchsorted(times, self._start + self._next / self.rate - self.latency)
        self._kept = times[kept:], spans[kept:], values[kept:]


def filtered(
    times: NDArray, spans: NDArray, values: NDArray, at: NDArray, rate: float
) -> NDArray[np.float64]:
    """Low-pass values [m, points], each of a span [s] round its time, at other times [k]; see `_filter`.

    A sum over the filter's length of values times span, over that of the filter alone: a constant
    stays what it is, also where the length of the substeps changes.
    """
    reach = _HALF / rate
    first = np.searchsorted(times, at - reach)
    last = np.searchsorted(times, at + reach)
    places = first[:, None] + np.arange((last - first).max())
    inside = places < last[:, None]
    places = np.minimum(places, len(times) - 1)
    ages = np.minimum(np.abs(times[places] - at[:, None]) * (rate * _FINE), _HALF * _FINE)
    whole = ages.astype(np.int64)
    taps, slopes = _filter()
    weights = (taps[whole] + slopes[whole] * (ages - whole)) * spans[places] * inside
    return np.einsum("kw,kwp->kp", weights / weights.sum(axis=1, keepdims=True), values[places])


@functools.cache
def _filter() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The filter's values from its middle on, `_FINE` to a sample, and from each to the next: a windowed sinc."""
    # a third of what a program imports that has no sensor
    from scipy.signal import firwin, kaiser_beta

    window = "kaiser", kaiser_beta(_ATTENUATION)
    taps = firwin(2 * _HALF * _FINE + 1, 2 * _CUT / _FINE, window=window)[_HALF * _FINE :]
    return taps, np.append(np.diff(taps), 0.0)


def _around(topology: TexelTopology, center: int, rings: int) -> NDArray[np.int64]:
    """The texels of some rings round one."""
    texels = np.array([center])
    for _ in range(rings):
        chart, row, column = np.unravel_index(texels, topology.shape)
        rows, columns = (each[:, None] + np.arange(3) for each in (row, column))
        square = topology.halo[chart[:, None, None], rows[:, :, None], columns[:, None, :]]
        texels = np.unique(np.append(texels, square[square >= 0]))
    return texels


class _Fit(NamedTuple):
    """Moving least squares (Lancaster and Salkauskas 1981) in the tangent plane: near texels count most.

    Attributes
    ----------
    degree : int
        Of the polynomial.
    rings : int
        Rings of texels that are fitted.
    softening, power : float
        The weight at a distance r, in texels, is 1 / (r^2 + softening)^power.
    growth : float
        Coefficients of a term are as cheap as its power of this: where texels do not suffice for
        all of them, as beside rims, 0.1 makes terms of a low order do what they can.
    """

    degree: int
    rings: int
    softening: float
    power: float
    growth: float


# The value at a point, and second derivatives there: the symbol of a quartic's is 0.7 dB low at
# five texels a wave, that of a cubic's 4 dB.
_VALUE = _Fit(degree=3, rings=2, softening=1e-3, power=1.0, growth=1.0)
_CURVATURE = _Fit(degree=4, rings=3, softening=0.1, power=2.0, growth=0.1)


def _row(
    atlas: Atlas, point: NDArray, center: int, laplacian: float | None
) -> tuple[NDArray, NDArray]:
    """Texels round a point, and the weights that give a field there, or a factor times its Laplacian [1/m^2].

    Those of a polynomial that fits the texels, see `_Fit`. It does not care where charts end.
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
    orders = [(i, j) for i in range(fit.degree + 1) for j in range(fit.degree + 1 - i)]
    growth = np.array([fit.growth ** (i + j) for i, j in orders])
    powers = np.stack([x**i * y**j for i, j in orders], axis=1)
    solved = growth[:, None] * np.linalg.pinv(near[:, None] * powers * growth, rcond=1e-6) * near
    if laplacian is None:
        return texels, solved[0]
    return texels, laplacian * 2 * (
        solved[orders.index((0, 2))] + solved[orders.index((2, 0))]
    ) / size**2


def _resolved(atlas: Atlas, material: Material, center: int) -> float:
    """Frequency [Hz] of the shortest wave that the texels round one carry, of the material there."""
    texels = _around(atlas.texels.topology, center, 1)
    away = np.linalg.norm(
        atlas.positions.reshape(-1, 3)[texels] - atlas.positions.reshape(-1, 3)[center], axis=1
    )
    widest = np.sort(away)[: min(5, len(away))].max()  # the four beside it
    return hertz(material, center, _TEXELS * widest)


def hertz(material: Material, texel: int, length: float) -> float:
    """Frequency [Hz] of a wave of a length [m], of the material at a texel of a flat index."""
    here = {
        name: value
        if np.ndim(value) == 0 or name == "wavelengths"
        else np.asarray(value).reshape(-1)[texel]
        for name, value in vars(material).items()
    }
    return frequency(Material(**here), 2 * np.pi / length) / (2 * np.pi)
