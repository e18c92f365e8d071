"""The equiangular cube map: places of texels on the sphere, and how the six charts are connected.

Chart order is +x, -x, +y, -y, +z, -z. A chart has a normal n and two axes u (columns) and v (rows)
with u x v = n. Texel (chart, row, column) looks along n + tan(pi/4 a) u + tan(pi/4 b) v with a = (2
column + 1)/N - 1 and b = (2 row + 1)/N - 1, so that texels are equally wide in angle along both
axes. A grid line that leaves a chart goes on as a grid line of the next one.

A triangle that crosses an edge of the cube is cut along it. One coordinate pair a corner cannot do
instead: equiangular coordinates continue smoothly beyond an edge, but there they leave the
neighbour's grid (its rows are not the continuation of this chart's rows), and at 90 degrees from
the chart's middle they end: a long triangle has none. Cut pieces lie in one chart each, with
coordinates in [0, 1] that any cube-map texture or array of six layers can be sampled at: with a
halo round each layer the result is continuous everywhere.
"""

from __future__ import annotations

import functools
import numbers

import numpy as np

from ...errors import AtlasError
from ...kernel import Floats, Ints, log
from ...memory import require_memory
from ...mesh.mesh import Mesh
from ...mesh.vectors import cross, dot
from ...texels.chart_map import Parts
from ...texels.gluing import glue
from ...texels.texel_areas import texel_areas
from ...texels.topology import TexelTopology

CHART_NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
CHART_U = np.array([[0, 1, 0], [0, -1, 0], [-1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]])
CHART_V = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 1, 0], [0, -1, 0]])

MIN_RESOLUTION = 4
MAX_RESOLUTION = 4096

# Memory that building an atlas takes, at least, for each texel [bytes].
_BYTES_PER_TEXEL = 200

# Texels from which on a warning says how long the atlas takes.
_MANY_TEXELS = 1e6

# Time that a texel takes [s], measured with `Ripples` of an ellipsoid at resolution 512.
_SECONDS_PER_TEXEL = 5e-6

# Round-off in units of a triangle: a corner that hangs over an edge by less counts as within, and
# smaller pieces are left out.
_ROUND_OFF = 1e-12

# Places for the corners of a polygon: a triangle that is cut by four planes has seven at most.
_MAX_CORNERS = 8

# The four planes through the cube's centre that bound each chart's share of space; inwards is
# positive.
_SIDES = np.stack(
    [
        CHART_NORMALS - CHART_U,
        CHART_NORMALS + CHART_U,
        CHART_NORMALS - CHART_V,
        CHART_NORMALS + CHART_V,
    ],
    axis=1,
).astype(np.float64)


def check_resolution(resolution: int) -> int:
    """Return the resolution N as an int; `AtlasError` if it is not a whole number in range."""
    whole = isinstance(resolution, numbers.Real) and resolution % 1 == 0
    if not whole or not MIN_RESOLUTION <= resolution <= MAX_RESOLUTION:
        raise AtlasError(
            "resolution must be a whole number of texels along a chart's side from "
            f"{MIN_RESOLUTION} to {MAX_RESOLUTION}, got {resolution!r}"
        )
    return int(resolution)


def check_memory(resolution: int) -> None:
    """Raise `AtlasError` if an atlas of about 6 N^2 texels cannot fit into memory.

    A warning says so if the atlas takes long.
    """
    atlas = f"an atlas of resolution {resolution}"
    texels = 6 * resolution**2
    require_memory(AtlasError, _BYTES_PER_TEXEL * texels, atlas, "take a lower resolution")
    if texels > _MANY_TEXELS:
        log.warning(
            "%s has about %d million texels, which take %.0f s or more",
            atlas,
            texels / 1e6,
            _SECONDS_PER_TEXEL * texels,
        )


def texel_directions(resolution: int) -> Floats:
    """Unit vectors through the texel centres, shape [6, N, N, 3]."""
    offset = 2 * np.arange(resolution) + 1 - resolution
    # tan is evaluated once per distance from the chart's middle, so that mirrored texels are
    # mirrored to the last bit
    tangent = np.sign(offset) * np.tan(np.pi / 4 * np.abs(offset) / resolution)
    a = tangent[None, None, :, None]
    b = tangent[None, :, None, None]
    directions = (
        CHART_NORMALS[:, None, None, :]
        + a * CHART_U[:, None, None, :]
        + b * CHART_V[:, None, None, :]
    )
    # the sum of squares in one order for all charts, for the same reason
    return directions / np.sqrt(1.0 + np.minimum(a * a, b * b) + np.maximum(a * a, b * b))


def cube_chart_points(directions: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
    """Chart, row and column of directions from the cube's centre (they need not be unit vectors).

    Row and column are float64 in texel units; 0.0 is the centre of the first texel. Each result has
    shape [k].
    """
    d = np.asarray(directions, dtype=np.float64).reshape(-1, 3)
    axis = np.argmax(np.abs(d), axis=1)
    main = np.take_along_axis(d, axis[:, None], axis=1)[:, 0]
    chart = 2 * axis + (main < 0)
    a = np.arctan(np.einsum("ij,ij->i", d, CHART_U[chart]) / np.abs(main)) * (4 / np.pi)
    b = np.arctan(np.einsum("ij,ij->i", d, CHART_V[chart]) / np.abs(main)) * (4 / np.pi)
    return chart, ((b + 1) * resolution - 1) / 2, ((a + 1) * resolution - 1) / 2


@functools.lru_cache(maxsize=8)
def cube_topology(resolution: int) -> TexelTopology:
    """The six charts of N x N texels, glued along the edges of the cube.

    At its eight corners three charts meet.
    """
    # outward from a chart's south, east, north and west side
    outward = np.stack([-CHART_V, CHART_U, CHART_V, -CHART_U], axis=1)
    beyond = (outward[:, :, None] == CHART_NORMALS).all(axis=-1).argmax(axis=-1)
    # the neighbour's side on which this chart lies
    back = (outward[beyond] == CHART_NORMALS[:, None, None]).all(axis=-1).argmax(axis=-1)
    return glue(np.stack([beyond, back], axis=-1), resolution)


def split_at_edges(corners: Floats) -> Parts:
    """Cut triangles with the directions [m, 3, 3] at their corners along the edges of the cube."""
    middles = corners.sum(axis=1)
    axis = np.argmax(np.abs(middles), axis=1)
    chart = 2 * axis + (np.take_along_axis(middles, axis[:, None], axis=1)[:, 0] < 0)
    inside = (np.einsum("mki,msi->mks", corners, _SIDES[chart]) >= -_ROUND_OFF).all(axis=(1, 2))
    whole = np.flatnonzero(inside)
    crossing = np.flatnonzero(~inside)
    owner, piece_chart, pieces = _cut(corners[crossing])
    triangle = np.concatenate([whole, crossing[owner]])
    order = np.argsort(triangle, kind="stable")
    barycentrics = np.concatenate([np.tile(np.eye(3), (len(whole), 1, 1)), pieces])[order]
    return triangle[order], barycentrics, np.concatenate([chart[whole], piece_chart])[order]


def covered_areas(mesh: Mesh, sphere: Floats, resolution: int) -> Floats:
    """Area of a mesh that each texel covers [m^2], [6, N, N]; see `texel_areas`.

    `sphere` is the mesh's sphere map.
    """
    directions = sphere[mesh.F]
    triangle, barycentrics, chart = split_at_edges(directions)
    axes = np.stack([CHART_U, CHART_V, CHART_NORMALS], axis=-1).astype(np.float64)
    corners = barycentrics @ directions[triangle] @ axes[chart]
    lines = np.tan(np.pi / 4 * (2 * np.arange(resolution + 1) / resolution - 1))
    return texel_areas(mesh, (triangle, barycentrics, chart), corners, lines, 6)


def chart_uv(directions: Floats, chart: Ints) -> Floats:
    """Equiangular place [k, ..., 2], from 0 to 1, of directions [k, ..., 3] in their charts [k]."""
    depth = np.einsum("p...i,pi->p...", directions, CHART_NORMALS[chart])
    sides = np.einsum("p...i,pij->p...j", directions, np.stack([CHART_U, CHART_V], axis=-1)[chart])
    return np.clip(0.5 + np.arctan(sides / depth[..., None]) * (2 / np.pi), 0.0, 1.0)


def _cut(corners: Floats) -> tuple[Ints, Ints, Floats]:
    """Cut triangles [k, 3, 3] into their parts in each chart.

    Returns the triangle, the chart and the barycentrics [pieces, 3, 3] of each part.
    """
    # every triangle begins as a polygon in each of the six charts
    owner, chart = np.divmod(np.arange(6 * len(corners)), 6)
    polygons = np.zeros((len(owner), _MAX_CORNERS, 3))
    sizes = np.full(len(owner), 3)
    polygons[:, :3] = np.eye(3)
    for side in range(4):
        polygons, sizes = _clip(polygons, sizes, corners[owner], _SIDES[chart, side])
        inside = sizes > 0
        owner = owner[inside]
        chart = chart[inside]
        polygons = polygons[inside]
        sizes = sizes[inside]
    # the polygons are cut into fans of triangles
    polygon, k = np.nonzero(np.arange(2, _MAX_CORNERS) < sizes[:, None])
    pieces = np.stack(
        [polygons[polygon, 0], polygons[polygon, k + 1], polygons[polygon, k + 2]], axis=1
    )
    a, b, c = pieces.transpose(1, 2, 0)
    area = dot(a, cross(b, c))  # in units of the whole triangle
    large = area > _ROUND_OFF
    return owner[polygon[large]], chart[polygon[large]], pieces[large]


def _clip(polygons: Floats, sizes: Ints, corners: Floats, planes: Floats) -> tuple[Floats, Ints]:
    """Cut convex polygons [p, 8, 3] by planes, and keep the inner parts.

    The method is that of Sutherland and Hodgman (1974).
    """
    clipped = np.zeros_like(polygons)
    count = np.zeros_like(sizes)
    previous = polygons[np.arange(len(sizes)), sizes - 1]
    previous_distance = _distance(previous, corners, planes)
    for i in range(sizes.max(initial=0)):
        corner = polygons[:, i]
        exists = i < sizes
        distance = _distance(corner, corners, planes)
        changes_side = (previous_distance >= 0) != (distance >= 0)
        crossing = np.flatnonzero(exists & changes_side)
        before = previous_distance[crossing, None]
        after = distance[crossing, None]
        # the formula gives the same bits if the two corners are swapped
        cuts = (before * corner[crossing] - after * previous[crossing]) / (before - after)
        clipped[crossing, count[crossing]] = cuts
        count[crossing] += 1
        inside = np.flatnonzero(exists & (distance >= 0))
        clipped[inside, count[inside]] = corner[inside]
        count[inside] += 1
        previous = corner
        previous_distance = distance
    return clipped, count


def _distance(weights: Floats, corners: Floats, planes: Floats) -> Floats:
    """Distance [p] from planes [p, 3] of points in triangles.

    The points are given by barycentrics [p, 3] in triangles with corners [p, 3, 3].
    """
    return dot(weights.T, [dot(corners[:, i].T, planes.T) for i in range(3)])
