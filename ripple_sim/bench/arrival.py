"""When does a wave arrive? Measured on an atlas, against exact geodesic distance.

A Gaussian bump of height exp(-d^2 / 2 w^2) is let go. On the plane its wave is known in closed form, with a crest that
lags behind the distance and a tail, as waves in two dimensions have them; so the time that is expected at a distance
is that of the same bump on the plane, and the bump's width is no error. Two times are taken: that of the first crest
itself, and the one at which the wave's front reaches half of that crest. On a surface with limbs several ways lead to
a point, and their waves run into one another's crests, but hardly into the front: the front tells more of the solver.
"""

from __future__ import annotations

import dataclasses
import functools

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.special import j0

from ripple_sim.solver import Atlas, WaveSolver
from ripple_sim.solver.texels.distance import distance_from_point
from ripple_sim.solver.texels.sampling import sampling_matrix

# Width of the bump in texels of an ideal even grid: wide enough to be carried, narrow beside the object's limbs.
WIDTH = 4.0

# Below this many widths from the source there is no crest yet.
NEAREST = 5.0

# A ripple below this share of the strongest signal is no crest.
_LEAST = 0.2

_SAMPLES_PER_WIDTH = 6


@dataclasses.dataclass(frozen=True)
class ArrivalError:
    """Relative errors of arrival times over the vertices of a mesh, median and 90 % quantile, and share under 3 %."""

    front_median: float
    front_q90: float
    front_under_3_percent: float
    crest_median: float
    crest_q90: float
    crest_under_3_percent: float


def arrival_error(atlas: Atlas, source: int, operator: str = "fem", backend: str = "cpu") -> ArrivalError:
    """Arrival at all vertices of the mesh, from the vertex `source`, at wave speed 1 m/s."""
    mesh = atlas.mesh
    vertices, none = np.arange(len(mesh.V)), np.empty(0, dtype=np.int64)
    distance = igl.exact_geodesic(mesh.V, mesh.F, np.array([source]), none, vertices, none)
    width = ideal_width(atlas)
    front, crest = arrival_times(atlas, mesh.V[source], atlas.sphere, width, distance.max(), operator, backend)
    far = distance > NEAREST * width
    expected_front, expected_crest = plane_arrival(distance[far] / width)
    figures: list[float] = []
    for time, expected in ((front[far], expected_front), (crest[far], expected_crest)):
        # no crest at all is as wrong as can be
        error = np.nan_to_num(np.abs(time / (expected * width) - 1), nan=1.0)
        figures += [float(np.median(error)), float(np.quantile(error, 0.9)), float((error < 0.03).mean())]
    return ArrivalError(*figures)


def ideal_width(atlas: Atlas) -> float:
    """Width of the bump [m]."""
    return WIDTH * float(np.sqrt(atlas.mesh.area / (6 * atlas.resolution**2)))


def spread_sources(atlas: Atlas, count: int) -> list[int]:
    """Vertices spread evenly over the atlas, the same for every call: nearest to a spiral on the sphere."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    spiral = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    return [int(vertex) for vertex in np.argmax(spiral @ atlas.sphere.T, axis=1)]


def arrival_times(
    atlas: Atlas,
    source: NDArray[np.float64],
    probes: NDArray[np.float64],
    width: float,
    distance: float,
    operator: str = "fem",
    backend: str = "cpu",
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s] at which the front and the first crest of a bump's wave arrive, at 1 m/s; NaN where there is none.

    Parameters
    ----------
    source : [3]
        Where the bump is [m].
    probes : [k, 3]
        Directions from the cube's centre, as `Atlas.project` gives them.
    width : float
        Of the bump [m].
    distance : float
        How far the wave is followed [m].
    """
    n = atlas.resolution
    sample = sampling_matrix(probes, n)
    waves = WaveSolver(atlas, operator=operator, backend=backend, conserve_volume=False)
    texels, away = distance_from_point(atlas, int(atlas.nearest_texel(source)[0]), source, 6 * width)
    bump = np.zeros(6 * n * n)
    bump[texels] = np.exp(-((away / width) ** 2) / 2)
    waves.height = bump.reshape(6, n, n)
    dt = width / _SAMPLES_PER_WIDTH
    signal = [sample @ waves.height.ravel()]
    for _ in range(int(np.ceil((1.1 * distance + 3 * width) / dt))):
        waves.step(dt)
        signal.append(sample @ waves.height.ravel())
    return _pick(dt * np.arange(len(signal)), np.array(signal))


def plane_arrival(distance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times of the front and the crest on the plane for the same bump; lengths in widths, wave speed 1."""
    grid, front, crest = _plane_table(float(max(np.max(distance, initial=0), NEAREST + 1)))
    return np.interp(distance, grid, front), np.interp(distance, grid, crest)


@functools.lru_cache(maxsize=16)
def _plane_table(farthest: float) -> tuple[NDArray[np.float64], ...]:
    """h(r, t) = integral of exp(-q^2 / 2) J0(q r) cos(q t) q dq, the bump's Hankel transform carried on in time."""
    grid = np.linspace(NEAREST - 1, farthest, 48)
    q = np.linspace(0, 8, 4001)[1:]
    spectrum = q * np.exp(-q * q / 2)
    around = np.linspace(-4, 3, 281)
    picked = []
    for r in grid:
        times = r + around
        height = np.cos(np.outer(times, q)) @ (spectrum * j0(q * r))
        picked.append(np.concatenate(_pick(times, height[:, None])))
    front, crest = np.array(picked).T
    return grid, front, crest


def _pick(times: NDArray, signal: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Front and first crest of signals [time, k], by interpolation between the samples."""
    probe = np.arange(signal.shape[1])
    before, here, after = signal[:-2], signal[1:-1], signal[2:]
    crests = (here >= before) & (here > after) & (here > _LEAST * signal.max(axis=0))
    i = np.argmax(crests, axis=0) + 1
    a, b, c = signal[i - 1, probe], signal[i, probe], signal[i + 1, probe]
    curvature = np.where(a - 2 * b + c < 0, a - 2 * b + c, -1)
    dt = times[1] - times[0]
    crest = times[i] + (a - c) / curvature / 2 * dt
    half = (b - (a - c) ** 2 / curvature / 8) / 2
    above = signal >= half
    above[0] = False
    j = np.maximum(np.argmax(above, axis=0), 1)
    low, high = signal[j - 1, probe], signal[j, probe]
    front = times[j - 1] + (half - low) / np.where(high > low, high - low, 1) * dt
    found = crests.any(axis=0)
    return np.where(found, front, np.nan), np.where(found, crest, np.nan)
