"""The atlas of any mesh in the patch layout, and its chart map.

The chart map is linear on pieces of the mesh's triangles.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import time

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints, kernel
from ...mesh.mesh import Mesh
from ...texels.atlas import Atlas
from ...texels.barycentrics import barycentrics_at, barycentrics_in
from ...texels.chart_map import Parts, uncut
from ...texels.detours import link_detours
from ...texels.gluing import glue
from ...texels.stretch import stretch_summary
from ...texels.texel_areas import texel_areas
from ...texels.texel_mesh import TexelMesh
from ...texels.topology import TexelTopology
from ..energy import COLUMN, FIXED
from .disks import signed_areas
from .layout import PatchMap, Report, patch_map, tell_nobody
from .parts import MIN_SIDE
from .pieces import Pieces, chart_pieces, warped
from .quads import CELLS
from .samples import Samples, centres, on_mesh, untangled
from .seamless import Complex, SeamlessMap, follow, places_seen_from
from .still import still_pieces, still_texels

# Texels along the side of a chart, at least, unless an atlas would have too many texels.
_USUAL_MIN_SIDE = 4

# Too many texels: so many times as many as were asked for.
_MAX_TEXEL_FACTOR = 3

# Texels of a cell that is worth having: five charts of 7 x 7. A coarse atlas has fewer cells.
_TEXELS_PER_CELL = 245

# Least number of cells of an atlas.
_MIN_CELLS = 24


@dataclasses.dataclass(frozen=True, eq=False)
class PatchChartMap:
    """Any mesh on charts; map coordinates are chart, column and row, the latter from 0 to 1.

    See `ChartMap`.
    """

    pieces: Pieces

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "patches"

    @functools.cached_property
    def _first(self) -> Ints:
        """Number of the first piece of each triangle, and one behind the last."""
        return np.searchsorted(self.pieces.triangle, np.arange(self.pieces.triangle[-1] + 2))

    def coordinates(self, mesh: Mesh, triangles: Ints, points: Floats) -> Floats:
        """Chart, column and row, [k, 3], of points [k, 3] [m] that lie on triangles [k]."""
        weights = barycentrics_in(mesh.V[mesh.F[triangles]], points)
        piece = np.empty(len(weights), np.int64)
        inside = np.empty((len(weights), 3))
        _find(self._first, self.pieces.barycentrics, triangles, weights, piece, inside)
        places = np.einsum("kc,kcj->kj", inside, self.pieces.places[piece])
        return np.concatenate([self.pieces.chart[piece, None], places], axis=1)

    def chart_points(self, coordinates: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
        """Chart, row and column, each [k]."""
        chart, column, row = coordinates.T
        return chart.astype(np.int64), row * resolution - 0.5, column * resolution - 0.5

    def texels_at(self, mesh: Mesh, resolution: int, triangles: Ints, points: Floats) -> Ints:
        """Flat indices [k] of the texels that contain points [k, 3] [m] on triangles [k]."""
        return _texels_on_pieces(
            mesh.V[mesh.F[triangles]], self._first, self.pieces, resolution, triangles, points
        )

    def linear_parts(self, mesh: Mesh) -> Parts:
        """The pieces."""
        chart = np.broadcast_to(self.pieces.chart[:, None, None], (len(self.pieces.chart), 3, 1))
        coordinates = np.concatenate([chart, self.pieces.places], axis=2)
        return self.pieces.triangle, self.pieces.barycentrics, coordinates

    def split(self, corners: Floats) -> Parts:
        """Parts of pieces as they are: each lies in one chart."""
        return uncut(corners[:, 0, 0].astype(np.int64))

    def uv(self, coordinates: Floats, chart: Ints) -> Floats:
        """Place [k, ..., 2] in the charts, 0 to 1, of map coordinates [k, ..., 3]."""
        return np.clip(coordinates[..., 1:], 0.0, 1.0)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Flipped pieces, stretch, and starved share of the area; see `Atlas.quality`."""
        pieces = self.pieces
        flat = signed_areas(self.pieces.places)
        # the determinant is the share of its triangle that each piece has
        real = mesh.triangle_areas[pieces.triangle] * np.abs(np.linalg.det(pieces.barycentrics))
        even = flat * mesh.area / (int(pieces.chart.max()) + 1)
        stretch = np.sqrt(real / np.maximum(even, np.finfo(np.float64).tiny))
        return {"flipped": int((flat <= 0).sum()), **stretch_summary(stretch, real)}

    def arrays(self) -> dict[str, NDArray]:
        """The pieces."""
        return {f"piece_{name}": array for name, array in self.pieces._asdict().items()}


@kernel
def _find(
    first: Ints, corners: Floats, triangles: Ints, weights: Floats, piece: Ints, inside: Floats
) -> None:
    """Piece in which each point lies, and the point's barycentrics in the piece.

    The points are given by triangles [k] and barycentrics [k, 3].
    """
    for i in range(len(triangles)):
        piece[i], s, t = _piece_at(first, corners, triangles[i], weights[i, 0], weights[i, 1])
        inside[i, 0] = 1 - s - t
        inside[i, 1] = s
        inside[i, 2] = t


@kernel
def _piece_at(
    first: Ints, corners: Floats, triangle: int, x: float, y: float
) -> tuple[int, float, float]:
    """The piece of a triangle in which a point lies, and the point's last two barycentrics."""
    best = -np.inf
    piece = min(first[triangle], len(corners) - 1)
    at_s = 1 / 3
    at_t = 1 / 3
    for p in range(first[triangle], first[triangle + 1]):
        a, b, c = corners[p]
        ux = b[0] - a[0]
        uy = b[1] - a[1]
        vx = c[0] - a[0]
        vy = c[1] - a[1]
        dx = x - a[0]
        dy = y - a[1]
        area = ux * vy - uy * vx
        if not area > 0:
            continue
        s = (dx * vy - dy * vx) / area
        t = (ux * dy - uy * dx) / area
        least = min(s, t, 1 - s - t)
        if least > best:
            best = least
            piece = p
            s = min(max(s, 0.0), 1.0)
            t = min(max(t, 0.0), 1.0)
            excess = max(s + t, 1.0)
            at_s = s / excess
            at_t = t / excess
    return piece, at_s, at_t


@kernel
def _texels_on_pieces(
    corners: Floats, first: Ints, pieces: Pieces, n: int, triangles: Ints, points: Floats
) -> Ints:
    """Texels [k] of points [k, 3] on triangles [k], whose corners [k, 3, 3] are given [m]."""
    texels = np.empty(len(points), np.int64)
    for i in range(len(points)):
        s, t = barycentrics_at(corners[i], points[i])
        piece, s, t = _piece_at(first, pieces.barycentrics, triangles[i], 1 - s - t, s)
        texel = pieces.chart[piece]
        for k in (1, 0):
            place = (1 - s - t) * pieces.places[piece, 0, k]
            place += s * pieces.places[piece, 1, k] + t * pieces.places[piece, 2, k]
            texel = texel * n + min(max(int(np.rint(place * n - 0.5)), 0), n - 1)
        texels[i] = texel
    return texels


def positions_beyond(
    patches: PatchMap, topology: TexelTopology, positions: NDArray
) -> Floats | None:
    """Positions with halo [C, n + 2, n + 2, 3] [m].

    Beyond a rim stands, for each texel beside it, the rim's point opposite to the texel.

    None if there is no rim. At the end of a rim, where that turns, lies its corner.
    """
    if not topology.rim.any():
        return None
    beyond = topology.with_halo(positions)
    beyond[(topology.halo < 0) | topology.rim] = np.nan
    seamless = patches.seamless
    surface = patches.surface
    sides = surface.edges.sides[surface.edges.rim, 0]
    f, k = np.divmod(sides, 3)
    corner = np.where(seamless.freedom[seamless.F[f, k]] != FIXED, k, (k + 1) % 3)
    homes, places = places_seen_from(seamless, f, corner)
    _draw_rims(seamless, surface.V, sides, corner, homes, places, beyond)
    n = topology.shape[1]
    for chart, corner in np.argwhere(topology.valence == 0):
        row, column = ((0, 0), (0, n + 1), (n + 1, n + 1), (n + 1, 0))[corner]
        if not topology.rim[chart, row, column]:
            continue
        other, r, c = np.unravel_index(topology.halo[chart, row, column], topology.shape)
        if other != chart:
            out_r, out_c = (0 if x == 0 else n + 1 for x in (r, c))
            along_rows = topology.rim[other, out_r, c + 1]
            beyond[chart, row, column] = (
                beyond[other, out_r, c + 1] if along_rows else beyond[other, r + 1, out_c]
            )
    # points in which a single chart ends at a rim lie in the corner of its halo
    f, k = np.nonzero((surface.at_rim & (seamless.freedom == FIXED))[surface.F])
    place = seamless.shift[f, k] * (n + 1)
    at = seamless.frame[f], place.imag.astype(np.int64), place.real.astype(np.int64)
    alone = topology.rim[at]
    beyond[tuple(each[alone] for each in at)] = surface.V[surface.F[f, k]][alone]
    return beyond


@kernel
def _draw_rims(
    seamless: SeamlessMap,
    V: Floats,
    sides: Ints,
    corner: Ints,
    homes: Ints,
    places: Complex,
    beyond: Floats,
) -> None:
    """Put the points of sides at a rim beyond the texels opposite; see `places_seen_from`."""
    n = beyond.shape[1] - 2
    for side in range(len(sides)):
        f = sides[side] // 3
        k = sides[side] % 3
        a = seamless.F[f, k]
        b = seamless.F[f, (k + 1) % 3]
        anchor = corner[side]
        p = places[side]
        v = seamless.F[f, anchor]
        along_row = seamless.freedom[v] == COLUMN
        a_place = p[k]
        b_place = p[(k + 1) % 3]
        low, high = (a_place.real, b_place.real) if along_row else (a_place.imag, b_place.imag)
        first = int(np.ceil(min(low, high) * n - 0.5 - 1e-9))
        last = int(np.floor(max(low, high) * n - 0.5 + 1e-9))
        for i in range(first, last + 1):
            along = (i + 0.5) / n
            t = min(max((along - low) / (high - low), 0.0), 1.0)
            opposite = (
                complex(along, p[anchor].imag) if along_row else complex(p[anchor].real, along)
            )
            chart, _, z = follow(seamless, homes[side], p[anchor], opposite)
            x = z.real
            y = z.imag
            row = int(np.floor(y * n)) + 1
            column = int(np.floor(x * n)) + 1
            if abs(y) < 1e-9:
                row = 0
            elif abs(y - 1) < 1e-9:
                row = n + 1
            elif abs(x) < 1e-9:
                column = 0
            else:
                column = n + 1
            for j in range(3):
                beyond[chart, row, column, j] = (1 - t) * V[a, j] + t * V[b, j]


def patch_atlas(mesh: Mesh, resolution: int, report: Report = tell_nobody) -> Atlas:
    """Atlas of about 6 N^2 texels, for a resolution N.

    Raises `AtlasError` if the mesh cannot be laid out.
    """
    start = time.perf_counter()
    texels = 6 * resolution**2
    patches = patch_map(mesh.V, mesh.F, cells_for(resolution), texels, report)
    mapped = time.perf_counter()
    report("putting texels on the surface")
    atlas = atlas_from_patch_map(mesh, patches, resolution)
    atlas.timings.update(patch_map=mapped - start, texels=time.perf_counter() - mapped)
    return atlas


def cells_for(resolution: int) -> int:
    """How many cells a mesh is cut into."""
    return int(np.clip(6 * resolution**2 / _TEXELS_PER_CELL, _MIN_CELLS, CELLS))


def chart_side(charts: int, resolution: int) -> int:
    """Texels along the side of each chart of an atlas."""
    asked = 6 * resolution**2
    side = round(float(np.sqrt(asked / charts)))
    most = math.isqrt(_MAX_TEXEL_FACTOR * asked // charts)
    return max(side, min(_USUAL_MIN_SIDE, most), MIN_SIDE)


def atlas_from_patch_map(mesh: Mesh, patches: PatchMap, resolution: int) -> Atlas:
    """Put texels on a mesh that is laid out on charts."""
    glued = patches.seamless.glued
    n = chart_side(len(glued), resolution)
    samples = centres(mesh, patches, n)
    topology = glue(glued, n)
    beyond = positions_beyond(patches, topology, samples.positions)
    samples, offsets = untangled(mesh, patches, topology, samples, beyond)
    pieces = chart_pieces(patches)
    if offsets.any():
        pieces = warped(pieces, offsets)
        beyond = positions_beyond(patches, topology, samples.positions)
    detours = link_detours(mesh, topology, samples.triangles, samples.barycentrics)
    if len(patches.still):
        # one more chart, of which no side is glued to another
        lies_still = np.append(np.zeros(len(glued), bool), True)
        topology = glue(np.append(glued, np.full((1, 4, 2), -1), axis=0), n, lies_still)
        samples = _with_still_texels(mesh, samples, patches.still)
        pieces = _sorted(pieces, still_pieces(patches.still, len(glued)))
        detours = np.pad(detours, ((0, 0), (0, 1), (0, 0), (0, 0)))
        if beyond is not None:
            beyond = np.pad(beyond, ((0, 1), (0, 0), (0, 0), (0, 0)), constant_values=np.nan)
    lines = np.linspace(0.0, 1.0, n + 1)
    corners = np.pad(pieces.places, ((0, 0), (0, 0), (0, 1)), constant_values=1.0)
    parts = pieces.triangle, pieces.barycentrics, pieces.chart
    return Atlas(
        mesh=mesh,
        texels=TexelMesh.of(
            topology,
            samples.positions,
            normals=samples.normals,
            beyond=beyond,
            covered=texel_areas(mesh, parts, corners, lines, topology.shape[0]),
            detours=detours,
        ),
        chart_map=PatchChartMap(pieces),
        triangles=samples.triangles,
        barycentrics=samples.barycentrics,
        notes=patches.notes,
    )


def _with_still_texels(mesh: Mesh, samples: Samples, still: Ints) -> Samples:
    """The texels of all charts, and of one more that holds the triangles that lie still."""
    triangles, weights = still_texels(still, samples.triangles.shape[1])
    added = on_mesh(mesh, triangles, weights)
    return Samples._make(
        np.append(all_, one[None], axis=0) for all_, one in zip(samples, added, strict=True)
    )


def _sorted(pieces: Pieces, more: Pieces) -> Pieces:
    """Pieces of different triangles as one, in the order of the triangles."""
    whole = Pieces._make(np.concatenate(arrays) for arrays in zip(pieces, more, strict=True))
    order = np.argsort(whole.triangle, kind="stable")
    return Pieces._make(array[order] for array in whole)
