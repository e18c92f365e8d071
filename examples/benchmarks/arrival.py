"""Errors of the times at which a wave arrives, for every formula and both sphere maps.

    python examples/benchmarks/arrival.py [MESH ...] [--resolution 96] [--sources 3] [--elements]

A Gaussian bump of height exp(-d^2 / 2 w^2) is let go. On the plane its wave is known in closed
form, with a crest that lags behind the distance and a tail, as waves in two dimensions have them;
so the time that is expected at an exact geodesic distance is that of the same bump on the plane,
and the bump's width is no error. Two times are taken: that of the first crest itself, and the one
at which the wave's front reaches half of that crest. On a surface with limbs several ways lead to a
point, and their waves run into one another's crests, but hardly into the front: the front tells
more of the solver.

A plane is not the object, though: curvature bends and focuses waves, and behind a handle the wave
that comes the other way round lifts the front of the one that is awaited. With `--elements` fronts
are compared with those of linear finite elements on the mesh itself, cut into triangles of half a
texel, and so are those of the plane.

Each formula is measured as it stands, at 1 m/s. Dynamic Paint's is measured once more with its
speed calibrated, as Blender's users do it by eye: one factor for the whole target, by which the
median arrival is right. Nobody else gets that. The paper's formula is also measured on the map that
the paper takes, the conformal one.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.special import j0

from ripple_sim.bench import table
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import (
    Atlas,
    Material,
    Mesh,
    MeshError,
    RippleError,
    WaveSolver,
    build_atlas,
    load_mesh,
)
from ripple_sim.solver.operator import OPERATORS
from ripple_sim.solver.texels import (
    TexelMesh,
    clean,
    distance_scratch,
    march,
    sampling_matrix,
    seeded,
)

# A ripple below this share of the strongest signal is no crest.
_LEAST = 0.2


def front_and_crest(
    times: NDArray, signal: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [k] of the front and of the first crest in signals [time, k], interpolated.

    The front is where the signal first reaches half of that crest. Both are NaN where there is no
    crest.
    """
    probe = np.arange(signal.shape[1])
    before = signal[:-2]
    here = signal[1:-1]
    after = signal[2:]
    crests = (here >= before) & (here > after) & (here > _LEAST * signal.max(axis=0))
    i = np.argmax(crests, axis=0) + 1
    a = signal[i - 1, probe]
    b = signal[i, probe]
    c = signal[i + 1, probe]
    curvature = np.where(a - 2 * b + c < 0, a - 2 * b + c, -1)
    dt = times[1] - times[0]
    crest = times[i] + (a - c) / curvature / 2 * dt
    half = (b - (a - c) ** 2 / curvature / 8) / 2
    above = signal >= half
    above[0] = False
    j = np.maximum(np.argmax(above, axis=0), 1)
    low = signal[j - 1, probe]
    high = signal[j, probe]
    front = times[j - 1] + (half - low) / np.where(high > low, high - low, 1) * dt
    found = crests.any(axis=0)
    return np.where(found, front, np.nan), np.where(found, crest, np.nan)


def geodesic_distance(mesh: Mesh, source: int) -> NDArray[np.float64]:
    """Exact geodesic distance of every vertex from one vertex [m]; infinite on other parts."""
    vertices = _reached_vertices(mesh, source)
    none = np.empty(0, dtype=np.int64)
    distance = np.full(len(mesh.V), np.inf)
    distance[vertices] = igl.exact_geodesic(
        mesh.V, mesh.F, np.array([source]), none, vertices, none
    )
    return distance


def _reached_vertices(mesh: Mesh, source: int) -> NDArray[np.int64]:
    """Vertices on the same part of a mesh as `source`, ascending: no wave comes to another."""
    part = np.full(len(mesh.V), -1)
    part[mesh.F] = mesh.components[:, None]
    return np.flatnonzero(part == part[source])


# Below this many widths from the source there is no crest yet.
NEAREST = 5.0


def plane_arrival(distance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times of the front and the crest of the bump on a plane; lengths in widths, speed 1."""
    # as far as the next power of 2: a table takes a second, and every source has another farthest
    # vertex
    farthest = 2 ** np.ceil(np.log2(max(np.max(distance, initial=0), NEAREST + 1)))
    grid, front, crest = _plane_table(float(farthest))
    return np.interp(distance, grid, front), np.interp(distance, grid, crest)


@functools.lru_cache(maxsize=16)
def _plane_table(farthest: float) -> tuple[NDArray[np.float64], ...]:
    """The bump's wave on a plane by its Hankel transform.

    h(r, t) = integral of exp(-q^2 / 2) J0(q r) cos(q t) q dq.
    """
    grid = np.linspace(NEAREST - 1, farthest, 96)
    q = np.linspace(0, 8, 2001)[1:]
    spectrum = q * np.exp(-q * q / 2)
    around = np.linspace(-4, 3, 281)
    picked = []
    for r in grid:
        times = r + around
        height = np.cos(np.outer(times, q)) @ (spectrum * j0(q * r))
        picked.append(np.concatenate(front_and_crest(times, height[:, None])))
    front, crest = np.array(picked).T
    return grid, front, crest


# Width of the bump in texels of an ideal even grid: wide enough to be resolved, narrow beside the
# object's limbs.
WIDTH = 4.0

_SAMPLES_PER_WIDTH = 6


@dataclasses.dataclass(frozen=True)
class ArrivalError:
    """Relative errors of arrival over a mesh: median, 90 % quantile, and share under 3 %."""

    front_median: float
    front_q90: float
    front_under_3_percent: float
    crest_median: float
    crest_q90: float
    crest_under_3_percent: float


@dataclasses.dataclass(frozen=True, eq=False)
class Arrival:
    """Arrival times at the vertices over the expected times: 1 is exact.

    Attributes
    ----------
    front, crest : float64 [k]
        Of the vertices that are far enough from the source; NaN where no crest arrives.
    """

    front: NDArray[np.float64]
    crest: NDArray[np.float64]

    def at_speed(self, factor: float) -> Arrival:
        """The same arrivals with waves faster by a factor, by which all times scale exactly."""
        return Arrival(self.front / factor, self.crest / factor)

    def error(self) -> ArrivalError:
        """Errors over all vertices; no crest at all counts as an error of 100 %."""
        figures: list[float] = []
        for ratio in (self.front, self.crest):
            error = np.nan_to_num(np.abs(ratio - 1), nan=1.0)
            figures += [
                float(np.median(error)),
                float(np.quantile(error, 0.9)),
                float((error < 0.03).mean()),
            ]
        return ArrivalError(*figures)


def arrival(atlas: Atlas, source: int, operator: str = "fem", speed: float = 1.0) -> Arrival:
    """Arrival at all vertices that can be reached from the vertex `source`, at 1 m/s.

    The solver's own speed [m/s] differs from that where a formula is calibrated.
    """
    mesh = atlas.mesh
    distance = geodesic_distance(mesh, source)
    vertices = np.flatnonzero(np.isfinite(distance))
    distance = distance[vertices]
    width = ideal_width(atlas)
    probes = vertex_coordinates(atlas)[vertices]
    waves = waves_of(atlas, mesh.V[source], probes, width, distance.max(), operator, speed)
    front, crest = front_and_crest(*waves)
    far = distance > NEAREST * width
    expected_front, expected_crest = plane_arrival(distance[far] / width)
    return Arrival(front[far] / (expected_front * width), crest[far] / (expected_crest * width))


def ideal_width(atlas: Atlas) -> float:
    """Width of the bump [m]."""
    return WIDTH * float(np.sqrt(atlas.mesh.area / atlas.areas.size))


def vertex_coordinates(atlas: Atlas) -> NDArray[np.float64]:
    """Map coordinates of the mesh's vertices [vertex_count, d], each in its own triangle."""
    mesh = atlas.mesh
    triangle = np.zeros(len(mesh.V), np.int64)
    triangle[mesh.F] = np.arange(len(mesh.F))[:, None]
    return atlas.chart_map.coordinates(mesh, triangle, mesh.V)


FINENESS = 2.0  # vertices of the elements in the width of a texel


def elements_waves(
    mesh: Mesh, source: int, width: float, distance: float, texels: float = WIDTH
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Wave of the same bump by linear elements and leapfrog: times and heights.

    Returns times [t] in seconds and heights at all vertices [t, n]. Masses are lumped. Triangles
    are cut into four until a texel has `FINENESS` vertices; the bump's width [m] has `texels`
    texels. The wave runs at 1 m/s for `distance` [m].
    """
    V = mesh.V
    F = mesh.F
    while np.sqrt(mesh.area / len(V)) > width / (FINENESS * texels):
        V, F = igl.upsample(V, F, 1)
    stiffness = -igl.cotmatrix(V, F).tocsr()
    inverse_mass = 1 / igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_BARYCENTRIC).diagonal()
    height = np.exp(-((_distance_near(V, F, source, 6 * width) / width) ** 2) / 2)
    # by Gershgorin's circles
    longest = 1.9 / np.sqrt((abs(stiffness).sum(axis=1).A1 * inverse_mass).max())
    times = _times(width, distance)
    substeps = int(np.ceil(times[1] / longest))
    dt = times[1] / substeps
    heights = [height[: len(mesh.V)].copy()]
    velocity = -dt / 2 * inverse_mass * (stiffness @ height)
    for _ in times[1:]:
        for _ in range(substeps):
            height += dt * velocity
            velocity -= dt * inverse_mass * (stiffness @ height)
        heights.append(height[: len(mesh.V)].copy())
    return times, np.array(heights)


def _times(width: float, distance: float) -> NDArray[np.float64]:
    """When waves are looked at [s], that a wave of 1 m/s takes for a distance [m]."""
    dt = width / _SAMPLES_PER_WIDTH
    return dt * np.arange(int(np.ceil((1.1 * distance + 3 * width) / dt)) + 1)


def _distance_near(V: NDArray, F: NDArray, source: int, limit: float) -> NDArray[np.float64]:
    """Exact geodesic distance from one vertex [m]; infinite beyond a limit [m]."""
    near = np.linalg.norm(V - V[source], axis=1) < 1.1 * limit
    triangles = F[near[F].all(axis=1)]
    # not another limb beside it: what no way leads to would be at no distance
    _, part = igl.facet_components(triangles)
    triangles = triangles[part == part[(triangles == source).any(axis=1)][0]]
    used, local = np.unique(triangles, return_inverse=True)
    start = np.searchsorted(used, [source])
    none = np.empty(0, dtype=np.int64)
    distance = np.full(len(V), np.inf)
    distance[used] = igl.exact_geodesic(
        V[used], local.reshape(-1, 3), start, none, np.arange(len(used)), none
    )
    return np.where(distance < limit, distance, np.inf)


def paper_atlas(mesh: Mesh, resolution: int) -> Atlas:
    """Atlas in the cube layout, or in the patch layout for a mesh that the cube does not fit."""
    try:
        return build_atlas(mesh, resolution, layout="cube")
    except MeshError:
        return build_atlas(mesh, resolution, layout="patches")


def against_elements(meshes: dict[str, Mesh], resolution: int, sources: int) -> str:
    """A table of the errors of fronts: median and 90 % quantile, by source, and the plane's."""
    rows = []
    for name, mesh in meshes.items():
        atlas = paper_atlas(mesh, resolution)
        width = ideal_width(atlas)
        coordinates = vertex_coordinates(atlas)
        for source in spread_sources(mesh, sources):
            distance = geodesic_distance(atlas.mesh, source)
            far = np.isfinite(distance) & (distance > NEAREST * width)
            farthest = distance[far].max()
            elements = front_and_crest(*elements_waves(atlas.mesh, source, width, farthest))[0][far]
            ours, _ = front_and_crest(
                *waves_of(atlas, atlas.mesh.V[source], coordinates[far], width, farthest)
            )
            plane = plane_arrival(distance[far] / width)[0] * width
            figures = [
                np.nan_to_num(np.abs(a / b - 1), nan=1.0)
                for a, b in ((ours, elements), (ours, plane), (elements, plane))
            ]
            rows.append(
                [
                    name,
                    str(source),
                    *(
                        f"{100 * np.quantile(each, q):.2f} %"
                        for each in figures
                        for q in (0.5, 0.9)
                    ),
                ]
            )
    return table(
        [
            "mesh",
            "source",
            "ours, elements",
            "90 %",
            "ours, plane",
            "90 %",
            "elements, plane",
            "90 %",
        ],
        rows,
    )


def distance_from_point(
    texels: TexelMesh, center: int, point: NDArray[np.float64], limit: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Texels within `limit` [m] of a surface point, and their distances along the surface.

    Texels are in ascending order.

    Parameters
    ----------
    center : int
        Flat index of the texel nearest to the point.
    point : [3]
        [m].
    """
    grid = texels.grid
    scratch = distance_scratch(len(grid.positions))
    seeds = seeded(grid.halo, grid.positions, center, point, scratch.distance, scratch.reached)
    reached_count, final_count = march(grid.halo, grid.positions, seeds, limit, scratch)
    reached = np.sort(scratch.order[:final_count])
    distance = scratch.distance[reached]
    clean(scratch, reached_count)
    return reached, distance


def waves_of(
    atlas: Atlas,
    source: NDArray[np.float64],
    probes: NDArray[np.float64],
    width: float,
    distance: float,
    operator: str = "fem",
    speed: float = 1.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times [s], [t], and heights at probes, [t, k], of a bump's wave.

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
    sample = sampling_matrix(
        atlas.texels.topology, *atlas.chart_map.chart_points(probes, atlas.resolution)
    )
    waves = WaveSolver(
        atlas, Material(speed=speed), operator=operator, backend="cpu", conserve_volume=False
    )
    texels, away = distance_from_point(
        atlas.texels, int(atlas.nearest_texel(source)[0]), source, 6 * width
    )
    bump = np.zeros(atlas.areas.size)
    bump[texels] = np.exp(-((away / width) ** 2) / 2)
    waves.height = bump.reshape(shape)
    times = _times(width, distance)
    heights = [sample @ waves.height.ravel()]
    for _ in times[1:]:
        waves.step(times[1])
        heights.append(sample @ waves.height.ravel())
    return times, np.array(heights)


def spread_sources(mesh: Mesh, count: int) -> list[int]:
    """Vertices at equal shares of the area of a mesh's largest part, in the order of its triangles.

    No map has a say in them, so that maps can be compared.
    """
    areas = mesh.triangle_areas
    part = mesh.components
    share = np.cumsum(np.where(part == np.argmax(np.bincount(part, areas)), areas, 0.0))
    return mesh.F[np.searchsorted(share, (np.arange(count) + 0.5) / count * share[-1]), 0].tolist()


CALIBRATED = "dynamic-paint, calibrated"
CONFORMAL = "paper, conformal map"

# Errors by their names in `ArrivalError`, and "speed factor" where the speed was calibrated; None
# where the sphere map was refused.
Row = dict[str, float] | None


def arrivals(
    meshes: dict[str, Mesh], resolution: int = 96, sources: int = 3
) -> dict[str, dict[str, Row]]:
    """Errors of arrival on the test body and on given meshes, averaged over the sources."""
    bodies = {"limbed": Mesh.from_arrays(*limbed())} | meshes
    return {name: _rows(mesh, resolution, sources) for name, mesh in bodies.items()}


def speed_factor(arrivals: Sequence[Arrival]) -> float:
    """Factor on the wave speed by which the median front over the whole target arrives in time."""
    return float(np.nanmedian(np.concatenate([each.front for each in arrivals])))


def _rows(mesh: Mesh, resolution: int, sources: int) -> dict[str, Row]:
    atlas = paper_atlas(mesh, resolution)
    vertices = spread_sources(mesh, sources)
    measured = {operator: _measure(atlas, vertices, operator) for operator in OPERATORS}
    rows: dict[str, Row] = {operator: mean_error(each) for operator, each in measured.items()}
    factor = speed_factor(measured["dynamic-paint"])
    calibrated = mean_error([each.at_speed(factor) for each in measured["dynamic-paint"]])
    rows[CALIBRATED] = {**calibrated, "speed factor": factor}
    rows[CONFORMAL] = None
    try:
        conformal = build_atlas(mesh, resolution, method="conformal", layout="cube")
    except RippleError:
        return rows
    rows[CONFORMAL] = mean_error(_measure(conformal, vertices, "paper"))
    return rows


def _measure(atlas: Atlas, vertices: Sequence[int], operator: str) -> list[Arrival]:
    return [arrival(atlas, vertex, operator) for vertex in vertices]


def mean_error(arrivals: Sequence[Arrival]) -> dict[str, float]:
    """Mean of the errors over several sources, by their names in `ArrivalError`."""
    rows = [dataclasses.asdict(each.error()) for each in arrivals]
    return {key: float(np.mean([row[key] for row in rows])) for key in rows[0]}


def as_text(table_of: dict[str, dict[str, Row]]) -> str:
    """Lay the errors of `arrivals` out for reading."""
    head = [
        "mesh",
        "operator",
        "front: median",
        "90 %",
        "under 3 %",
        "crest: median",
        "90 %",
        "under 3 %",
        "speed",
    ]
    rows = []
    for mesh, operators in table_of.items():
        for operator, row in operators.items():
            if row is None:
                rows.append([mesh, operator, "refused: no sphere map without folds", *[""] * 6])
                continue
            errors = [f"{100 * value:.2f} %" for key, value in row.items() if key != "speed factor"]
            rows.append(
                [
                    mesh,
                    operator,
                    *errors,
                    f"x {row['speed factor']:.3f}" if "speed factor" in row else "",
                ]
            )
    return table(head, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description="Times of arrival against exact geodesics.")
    parser.add_argument("meshes", type=Path, nargs="*")
    parser.add_argument("--resolution", type=int, default=96)
    parser.add_argument("--sources", type=int, default=3)
    parser.add_argument(
        "--elements", action="store_true", help="compare with finite elements on the mesh instead"
    )
    options = parser.parse_args()
    meshes = {path.stem: load_mesh(path) for path in options.meshes}
    if options.elements:
        print(against_elements(meshes, options.resolution, options.sources))
    else:
        print(as_text(arrivals(meshes, options.resolution, options.sources)))


if __name__ == "__main__":
    main()
