"""When does a wave arrive? Measured on an atlas, against exact geodesic distance.

A Gaussian bump of height exp(-d^2 / 2 w^2) is let go. On the plane its wave is known in closed form, with a crest that
lags behind the distance and a tail, as waves in two dimensions have them; so the time that is expected at a distance
is that of the same bump on the plane, and the bump's width is no error. Two times are taken: that of the first crest
itself, and the one at which the wave's front reaches half of that crest. On a surface with limbs several ways lead to
a point, and their waves run into one another's crests, but hardly into the front: the front tells more of the solver.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, Material, WaveSolver
from ripple_sim.solver.texels.distance import distance_from_point
from ripple_sim.solver.texels.topology import sampling_matrix

from .first_crest import front_and_crest
from .geodesics import geodesic_distance
from .plane_wave import NEAREST, plane_arrival

# Width of the bump in texels of an ideal even grid: wide enough to be resolved, narrow beside the object's limbs.
WIDTH = 4.0

_SAMPLES_PER_WIDTH = 6


@dataclasses.dataclass(frozen=True)
class ArrivalError:
    """Relative errors of arrival times over the vertices of a mesh: median, 90 % quantile, and share under 3 %."""

    front_median: float
    front_q90: float
    front_under_3_percent: float
    crest_median: float
    crest_q90: float
    crest_under_3_percent: float


@dataclasses.dataclass(frozen=True, eq=False)
class Arrival:
    """Times of arrival at the vertices of a mesh over the expected ones: 1 is exact, NaN where no crest arrives.

    Attributes
    ----------
    front, crest : float64 [k]
        Of the vertices that are far enough from the source.
    """

    front: NDArray[np.float64]
    crest: NDArray[np.float64]

    def at_speed(self, factor: float) -> Arrival:
        """The same arrivals with waves that are so much faster: the wave equation's times scale exactly."""
        return Arrival(self.front / factor, self.crest / factor)

    def error(self) -> ArrivalError:
        """Errors over all vertices; no crest at all counts as an error of 100 %."""
        figures: list[float] = []
        for ratio in (self.front, self.crest):
            error = np.nan_to_num(np.abs(ratio - 1), nan=1.0)
            figures += [float(np.median(error)), float(np.quantile(error, 0.9)), float((error < 0.03).mean())]
        return ArrivalError(*figures)


def arrival_error(atlas: Atlas, source: int, operator: str = "fem") -> ArrivalError:
    """Error of arrival at all vertices that can be reached from the vertex `source`."""
    return arrival(atlas, source, operator).error()


def arrival(atlas: Atlas, source: int, operator: str = "fem", speed: float = 1.0) -> Arrival:
    """Arrival at all vertices that can be reached from the vertex `source`; expected is a wave speed of 1 m/s.

    The solver's own speed [m/s] differs from that where a formula is calibrated.
    """
    mesh = atlas.mesh
    distance = geodesic_distance(mesh, source)
    vertices = np.flatnonzero(np.isfinite(distance))
    distance = distance[vertices]
    width = ideal_width(atlas)
    probes = _vertex_coordinates(atlas)[vertices]
    front, crest = arrival_times(atlas, mesh.V[source], probes, width, distance.max(), operator, speed)
    far = distance > NEAREST * width
    expected_front, expected_crest = plane_arrival(distance[far] / width)
    return Arrival(front[far] / (expected_front * width), crest[far] / (expected_crest * width))


def ideal_width(atlas: Atlas) -> float:
    """Width of the bump [m]."""
    return WIDTH * float(np.sqrt(atlas.mesh.area / atlas.areas.size))


def _vertex_coordinates(atlas: Atlas) -> NDArray[np.float64]:
    """Map coordinates of the mesh's vertices, [vertex_count, d], each in a triangle of its own sheet."""
    mesh = atlas.mesh
    triangle = np.zeros(len(mesh.V), np.int64)
    triangle[mesh.F] = np.arange(len(mesh.F))[:, None]
    return atlas.chart_map.coordinates(mesh, triangle, mesh.V)


def arrival_times(
    atlas: Atlas,
    source: NDArray[np.float64],
    probes: NDArray[np.float64],
    width: float,
    distance: float,
    operator: str = "fem",
    speed: float = 1.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s] at which the front and the first crest of a bump's wave arrive; NaN where there is none.

    Parameters
    ----------
    source : [3]
        Where the bump is [m].
    probes : [k, d]
        Map coordinates, as `Atlas.project` gives them: directions, or places on the charts.
    width : float
        Of the bump [m].
    distance : float
        How far a wave of 1 m/s is followed [m].
    operator : str
        As `WaveSolver` has them.
    speed : float
        Wave speed [m/s].
    """
    shape = atlas.areas.shape
    sample = sampling_matrix(atlas.texels.topology, *atlas.chart_map.chart_points(probes, atlas.resolution))
    waves = WaveSolver(atlas, Material(speed=speed), operator=operator, backend="cpu", conserve_volume=False)
    texels, away = distance_from_point(atlas.texels, int(atlas.nearest_texel(source)[0]), source, 6 * width)
    bump = np.zeros(atlas.areas.size)
    bump[texels] = np.exp(-((away / width) ** 2) / 2)
    waves.height = bump.reshape(shape)
    dt = width / _SAMPLES_PER_WIDTH
    signal = [sample @ waves.height.ravel()]
    for _ in range(int(np.ceil((1.1 * distance + 3 * width) / dt))):
        waves.step(dt)
        signal.append(sample @ waves.height.ravel())
    return front_and_crest(dt * np.arange(len(signal)), np.array(signal))
