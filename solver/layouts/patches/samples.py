"""Where texels lie on a surface: triangles of a seamless map, drawn on the charts as on a screen.

Then texels are moved a little where the texel mesh is folded, though the map is not. Samples of a
fold-free map may still lie in the wrong order on the surface: astride of a knife edge, whose two
sides they see from above and from below, or round the tip of a cone. There each texel tries the
other places of its square, on a fine lattice, and takes the one where the corners between its
neighbours face outwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...errors import AtlasError
from ...kernel import Bools, Floats, Ints, kernel
from ...mesh.mesh import Mesh
from ...mesh.vectors import cross, dot, subtract
from ...texels.normals import facing_out
from ...texels.topology import TexelTopology
from .layout import PatchMap
from .seamless import Complex, SeamlessMap, follow, places_on_charts, wedge

# Sine of a corner that is wide enough.
_MIN_CORNER_SINE = 0.1

# Row and column of a texel's neighbours, counter-clockwise.
_NEIGHBOURS = ((0, 1), (1, 0), (0, -1), (-1, 0))

# A texel belongs to a triangle if its barycentric coordinates are no more than this below 0.
_ROUND_OFF = 1e-7

# Charts over which a triangle may reach, beyond the chart in which it begins.
_CHARTS_BEYOND = 2

# Places that a texel may take along the side of its square; odd, so that one is the centre.
_LATTICE = 7

# Fault of a texel that has moved from the centre of its square by the width of a texel; it grows
# with the square of the way.
_PULL = 0.02

# Least area at a corner of the moved lattice on its chart, in units of a texel's square.
_MIN_LATTICE_CORNER = 0.2

# Passes over the folded texels of a round, at most.
_MAX_SWEEPS = 6

# Rounds that look for folded texels and move them, at most.
_MAX_ROUNDS = 6

# Texels round a folded one that may move along with it, in each direction.
_TEXELS_AROUND = 2


class Texels(NamedTuple):
    """Texels that move, and what lies round them."""

    halo: Ints  # [C, n + 2, n + 2]
    rim: Bools
    beyond: Floats  # [C, n + 2, n + 2, 3] [m]; beyond a rim, else NaN
    positions: Floats  # [C n^2, 3] [m]
    normals: Floats  # [C n^2, 3]
    offsets: Ints  # [C, n + 2, n + 2, 2], column and row, in places of the lattice; 0 in the halo


@kernel
def _place(texels: Texels, chart: int, row: int, column: int) -> Floats:
    """Position of a place in a chart with halo [m], [3]; NaN where there is nothing."""
    if texels.rim[chart, row, column] or texels.halo[chart, row, column] < 0:
        return texels.beyond[chart, row, column]
    return texels.positions[texels.halo[chart, row, column]]


@kernel
def _fault(texels: Texels, flat: int) -> float:
    """How badly the four corners of a texel between its neighbours face outwards.

    It is 1 or more if one of them is folded.
    """
    n = texels.halo.shape[1] - 2
    chart = flat // (n * n)
    row = flat // n % n + 1
    column = flat % n + 1
    own = texels.positions[flat]
    normal = texels.normals[flat]
    fault = 0.0
    for i, j in _NEIGHBOURS:
        p = _place(texels, chart, row + i, column + j)
        q = _place(texels, chart, row + j, column - i)
        a = subtract(p, own)
        b = subtract(q, own)
        facing = dot(cross(a, b), normal)
        size = np.sqrt(dot(a, a) * dot(b, b))
        # NaN, where there is no neighbour, is not below the margin
        if facing < _MIN_CORNER_SINE * size:
            fold = 1.0 if facing < 0.0 else 0.0
            lack = _MIN_CORNER_SINE - facing / max(size, 1e-300)
            fault += fold + lack**2
    return fault


@kernel
def faults(texels: Texels, flat: int) -> float:
    """Faults of a texel and of its four neighbours, added up."""
    n = texels.halo.shape[1] - 2
    chart = flat // (n * n)
    row = flat // n % n + 1
    column = flat % n + 1
    total = _fault(texels, flat)
    for i, j in _NEIGHBOURS:
        other = texels.halo[chart, row + i, column + j]
        if other >= 0 and not texels.rim[chart, row + i, column + j]:
            total += _fault(texels, other)
    return total


@kernel
def folded(texels: Texels) -> Bools:
    """Mask of the texels that are folded between their neighbours, [T]."""
    result = np.zeros(len(texels.positions), np.bool_)
    for flat in range(len(result)):
        result[flat] = _fault(texels, flat) >= 1.0
    return result


def locate_texels(seamless: SeamlessMap, n: int) -> tuple[Ints, Floats]:
    """Triangle [C, n, n] and barycentrics [C, n, n, 3] of each of the n x n texels of all charts.

    Raises `AtlasError` if a texel lies in no triangle, which a map without a fold rules out.
    """
    triangles, barycentrics = locate_in_charts(seamless, n, np.arange(len(seamless.glued)))
    missed = int((triangles < 0).sum())
    if missed:
        raise AtlasError(f"{missed} texels lie in no triangle of the map onto the charts")
    return triangles, barycentrics


def locate_in_charts(seamless: SeamlessMap, n: int, charts: Ints) -> tuple[Ints, Floats]:
    """Triangles and barycentrics of the texels of some charts [k]; see `locate_texels`.

    A triangle is -1 if none is found: one that reaches far over other charts may be missed.
    """
    number = np.full(len(seamless.glued), -1)
    number[charts] = np.arange(len(charts))
    near = number >= 0
    beside = seamless.glued[..., 0]
    for _ in range(_CHARTS_BEYOND):
        near |= (near[beside] & (beside >= 0)).any(axis=1)
    corner, homes, places = places_on_charts(seamless)
    triangles, barycentrics, best = _draw(
        seamless, np.flatnonzero(near[homes]), corner, homes, places, number, n
    )
    triangles[best < -_ROUND_OFF] = -1
    return triangles, barycentrics


@kernel
def _draw(
    seamless: SeamlessMap,
    chosen: Ints,
    corner: Ints,
    homes: Ints,
    places: Complex,
    number: Ints,
    n: int,
) -> tuple[Ints, Floats, Floats]:
    """Find the texels of the charts that have a number in chosen triangles; see `places_on_charts`.

    Returns the triangle of each, -1 where there is none, and its barycentric coordinates, and the
    least of these.
    """
    shape = (number.max() + 1, n, n)
    slack = 1e-9
    triangles = np.full(shape, -1)
    barycentrics = np.zeros((*shape, 3))
    best = np.full(shape, -np.inf)
    for f in chosen:
        home = homes[f]
        k = corner[f]
        p = places[f]
        u = p[1] - p[0]
        v = p[2] - p[0]
        area = wedge(u, v)
        first = int(np.ceil((min(p[0].imag, p[1].imag, p[2].imag) - slack) * n - 0.5))
        last = int(np.floor((max(p[0].imag, p[1].imag, p[2].imag) + slack) * n - 0.5))
        left = int(np.ceil((min(p[0].real, p[1].real, p[2].real) - slack) * n - 0.5))
        right = int(np.floor((max(p[0].real, p[1].real, p[2].real) + slack) * n - 0.5))
        for i in range(first, last + 1):
            for j in range(left, right + 1):
                z = complex((j + 0.5) / n, (i + 0.5) / n)
                s = wedge(z - p[0], v) / area
                t = wedge(u, z - p[0]) / area
                least = min(s, t, 1 - s - t)
                if least < -1e-6:
                    continue
                found, _, place = follow(seamless, home, p[k], z)
                chart = number[found]
                row = int(np.floor(place.imag * n))
                column = int(np.floor(place.real * n))
                if (
                    chart < 0
                    or not (0 <= row < n and 0 <= column < n)
                    or least <= best[chart, row, column]
                ):
                    continue
                best[chart, row, column] = least
                triangles[chart, row, column] = f
                inside = barycentrics[chart, row, column]
                inside[0] = 1 - s - t
                inside[1] = s
                inside[2] = t
    return triangles, barycentrics, best


class Samples(NamedTuple):
    """Points on a grid of charts.

    Attributes
    ----------
    small : int64 [..., n, n]
        Triangles of the surface that the charts are made of.
    weights : float64 [..., n, n, 3]
        Barycentric coordinates in them.
    triangles : int64 [..., n, n]
        Triangles of the mesh.
    barycentrics : float64 [..., n, n, 3]
        In those.
    positions, normals : float64 [..., n, n, 3]
        [m], and unit.
    """

    small: Ints
    weights: Floats
    triangles: Ints
    barycentrics: Floats
    positions: Floats
    normals: Floats


def sampled(mesh: Mesh, patches: PatchMap, small: Ints, weights: Floats) -> Samples:
    """Points at barycentric coordinates in triangles of the surface."""
    surface = patches.surface
    positions = np.einsum("...k,...kj->...j", weights, surface.V[surface.F[small]])
    triangles = surface.parent[small]
    barycentrics = np.einsum("...k,...kj->...j", weights, surface.inside[small])
    normals = _normals(mesh, triangles, barycentrics)
    return Samples(small, weights, triangles, barycentrics, positions, normals)


def on_mesh(mesh: Mesh, triangles: Ints, barycentrics: Floats) -> Samples:
    """Points at barycentric coordinates in triangles of the mesh, which no cut has made smaller."""
    positions = np.einsum("...k,...kj->...j", barycentrics, mesh.V[mesh.F[triangles]])
    normals = _normals(mesh, triangles, barycentrics)
    return Samples(triangles, barycentrics, triangles, barycentrics, positions, normals)


def _normals(mesh: Mesh, triangles: Ints, barycentrics: Floats) -> Floats:
    """Unit normals at points of the mesh."""
    at_corners = mesh.vertex_normals[mesh.F[triangles]]
    normals = np.einsum("...k,...kj->...j", barycentrics, at_corners)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    units = np.where(length > 1e-9, normals / np.maximum(length, 1e-9), at_corners[..., 0, :])
    return facing_out(units, mesh, triangles)


def centres(mesh: Mesh, patches: PatchMap, n: int) -> Samples:
    """The centres of n x n squares of every chart."""
    return sampled(mesh, patches, *locate_texels(patches.seamless, n))


def untangled(
    mesh: Mesh, patches: PatchMap, topology: TexelTopology, samples: Samples, beyond: Floats | None
) -> tuple[Samples, Floats]:
    """Move texels from the centres of their squares to places where fewer are folded.

    `beyond` is that of `TexelMesh`.

    Returns them, and the column and row by which each has moved, in texels, below 0.5, [C, n, n,
    2].
    """
    charts, n, _ = topology.shape
    outside = np.full((charts, n + 2, n + 2, 3), np.nan)
    if beyond is not None:
        outside[topology.rim] = beyond[topology.rim]
    offsets = np.zeros((charts, n + 2, n + 2, 2), np.int64)
    small = samples.small.copy()
    weights = samples.weights.copy()
    positions = samples.positions.reshape(-1, 3).copy()
    normals = samples.normals.reshape(-1, 3).copy()
    texels = Texels(topology.halo, topology.rim, outside, positions, normals, offsets)
    for _ in range(_MAX_ROUNDS):
        near = folded(texels).reshape(topology.shape)
        for _ in range(_TEXELS_AROUND):
            near = _grown(near, topology)
        active = np.flatnonzero(near)
        if not len(active):
            break
        chosen, index = np.unique(active // (n * n), return_inverse=True)
        triangles, barycentrics = locate_in_charts(patches.seamless, n * _LATTICE, chosen)
        lattice = sampled(mesh, patches, triangles, barycentrics)
        number = np.searchsorted(chosen, np.arange(charts))
        is_known = (lattice.small >= 0)[..., None]
        lattice_positions = np.where(is_known, lattice.positions, np.nan)
        for i in range(_MAX_SWEEPS):
            in_turn = active[:: 1 if i % 2 == 0 else -1].copy()
            if not _improve(texels, number, lattice_positions, lattice.normals, in_turn):
                break
        chart, row, column = np.unravel_index(active, topology.shape)
        offset = offsets[chart, row + 1, column + 1]
        lattice_row = row * _LATTICE + _LATTICE // 2 + offset[:, 1]
        lattice_column = column * _LATTICE + _LATTICE // 2 + offset[:, 0]
        moved = offset.any(axis=1)
        source = (index[moved], lattice_row[moved], lattice_column[moved])
        target = (chart[moved], row[moved], column[moved])
        small[target] = lattice.small[source]
        weights[target] = lattice.weights[source]
    return sampled(mesh, patches, small, weights), offsets[:, 1:-1, 1:-1] / _LATTICE


def _grown(mask: Bools, topology: TexelTopology) -> Bools:
    """A mask of texels [C, n, n] with the eight neighbours of each texel."""
    n = mask.shape[1]
    halo = topology.with_halo(mask)
    shifted = []
    for i in range(3):
        for j in range(3):
            shifted.append(halo[:, i : i + n, j : j + n])
    return np.any(shifted, axis=0)


@kernel
def _fits(offsets: Floats, row: int, column: int) -> bool:
    """Whether the four squares round a moved texel have wide corners on its chart."""
    n = offsets.shape[0] - 2
    least = _MIN_LATTICE_CORNER * _LATTICE * _LATTICE
    x = np.empty(4)
    y = np.empty(4)
    for i in range(row - 1, row + 1):
        for j in range(column - 1, column + 1):
            for k in range(4):
                r = i + (1 if k >= 2 else 0)
                c = j + (1 if k == 1 or k == 2 else 0)
                # the border of the chart lies half a texel beyond the last ones, and does not move
                x[k] = _LATTICE * min(max(float(c), 0.5), n + 0.5) + offsets[r, c, 0]
                y[k] = _LATTICE * min(max(float(r), 0.5), n + 0.5) + offsets[r, c, 1]
            share = 0.5 if i == 0 or i == n else 1.0
            share *= 0.5 if j == 0 or j == n else 1.0
            for k in range(4):
                a = (k + 1) % 4
                b = (k + 3) % 4
                if (x[a] - x[k]) * (y[b] - y[k]) - (y[a] - y[k]) * (x[b] - x[k]) < least * share:
                    return False
    return True


@kernel
def _improve(texels: Texels, number: Ints, positions: Floats, normals: Floats, active: Ints) -> int:
    """Move each of these texels to its best place, one after the other; return how many moved.

    Places that texels of some charts may take, [k, n m, n m, 3] [m], NaN where unknown, with their
    normals; `number` [C] is that of a chart among these.
    """
    n = texels.halo.shape[1] - 2
    half = _LATTICE // 2
    moved = 0
    for flat in active:
        chart = flat // (n * n)
        row = flat // n % n + 1
        column = flat % n + 1
        index = number[chart]
        offset = texels.offsets[chart, row, column]
        ox = offset[0]
        oy = offset[1]
        point = texels.positions[flat].copy()
        normal = texels.normals[flat].copy()
        least = faults(texels, flat) + _PULL * (ox * ox + oy * oy) / (_LATTICE * _LATTICE)
        if least < 1e-12:
            continue
        best_x = ox
        best_y = oy
        for i in range(-half, half + 1):
            for j in range(-half, half + 1):
                pull = _PULL * (i * i + j * j) / (_LATTICE * _LATTICE)
                offset[0] = j
                offset[1] = i
                r = (row - 1) * _LATTICE + half + i
                c = (column - 1) * _LATTICE + half + j
                if pull >= least or not _fits(texels.offsets[chart], row, column):
                    continue
                texels.positions[flat] = positions[index, r, c]
                texels.normals[flat] = normals[index, r, c]
                if not texels.positions[flat, 0] < np.inf:
                    continue
                fault = faults(texels, flat) + pull
                if fault < least - 1e-9:
                    least = fault
                    best_x = j
                    best_y = i
        offset[0] = best_x
        offset[1] = best_y
        if best_x == ox and best_y == oy:
            texels.positions[flat] = point
            texels.normals[flat] = normal
        else:
            r = (row - 1) * _LATTICE + half + best_y
            c = (column - 1) * _LATTICE + half + best_x
            texels.positions[flat] = positions[index, r, c]
            texels.normals[flat] = normals[index, r, c]
            moved += 1
    return moved
