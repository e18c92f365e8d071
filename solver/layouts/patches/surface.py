"""The triangles of a mesh, cut into smaller ones that know where they came from.

They are cut in the middle of edges, long ones and those that join two points of a border; along
straight lines, from the middles of flat polygons to the middles of their sides; and along the
borders of cells.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np

from ...kernel import Bools, Floats, Ints
from ...mesh.topology import SPLITS, Edges, corner_angles, edges_of, triangle_areas

# Of a triangle abc: its corners, a point on each of its sides, and one inside.
A, B, C, AB, BC, CA, MIDDLE = range(7)

Patterns = Mapping[int, Sequence[Sequence[int]]]  # see `SPLITS`

# Distance from a ray up to which a vertex lies on it, in units of a polygon's radius.
_MAX_OFF_RAY = 1e-9

# Shortest side over longest side of a needle, at most.
_MAX_NEEDLE_WIDTH = 0.125

# Passes that split long edges.
_MAX_REFINEMENTS = 100

# Triangles above which a part is not refined any more.
_MAX_TRIANGLES = 20_000

# A part that has many triangles to begin with may grow to so many times as many.
_MAX_TRIANGLE_GROWTH = 2


@dataclasses.dataclass(frozen=True, eq=False)
class TriangleSurface:
    """Triangles that cover a mesh; each is a part of one of its triangles, its parent.

    Attributes
    ----------
    V : float64 [n, 3]
        Points [m].
    F : int64 [m, 3]
    parent : int64 [m]
        Triangle of the mesh in which each lies.
    inside : float64 [m, 3, 3]
        Barycentric coordinates in it, of the three corners.
    """

    V: Floats
    F: Ints
    parent: Ints
    inside: Floats

    @classmethod
    def of(cls, V: Floats, F: Ints) -> TriangleSurface:
        """The triangles of a mesh as they are."""
        return cls(V, F, np.arange(len(F)), np.broadcast_to(np.eye(3), (len(F), 3, 3)))

    @functools.cached_property
    def edges(self) -> Edges:
        """Edges of the triangles."""
        return edges_of(self.F)

    @functools.cached_property
    def edge_lengths(self) -> Floats:
        """Lengths of the edges [m], [e]."""
        ends = self.V[self.edges.ends]
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)

    @functools.cached_property
    def areas(self) -> Floats:
        """Areas of the triangles [m^2], [m]."""
        return triangle_areas(self.V, self.F)

    @functools.cached_property
    def angles(self) -> Floats:
        """Angles in the corners of the triangles, [m, 3]."""
        return corner_angles(self.V, self.F)

    @functools.cached_property
    def at_rim(self) -> Bools:
        """Vertices at a rim, [n]."""
        at_rim = np.zeros(len(self.V), bool)
        at_rim[self.edges.ends[self.edges.rim]] = True
        return at_rim

    def subdivided(
        self, places: Floats, patterns: Patterns = SPLITS
    ) -> tuple[TriangleSurface, Ints, Ints, Floats]:
        """Cut edges, and the triangles beside them.

        Parameters
        ----------
        places : float64 [e]
            Where each edge is cut, between 0 at its first end and 1; NaN where it is not.
        patterns : dict, optional
            For each set of cut sides of a triangle (1 for ab, 2 for bc, 4 for ca, added up) the
            triangles to put in its place, by the seven points named in this module; they are put in
            the order of these sets.

        Returns
        -------
        TriangleSurface
            Its first vertices are those from before.
        middles : int64 [e]
            The new vertex on each edge from before; -1 where it was not cut.
        origin : int64 [m]
            Of each triangle, the one from before in which it lies.
        weights : float64 [m, 3, 3]
            Barycentric coordinates in that one, of its corners.
        """
        edges = self.edges
        count = len(self.V)
        cut = np.flatnonzero(~np.isnan(places))
        middles = np.full(len(edges.ends), -1)
        middles[cut] = count + np.arange(len(cut))
        t = places[cut][:, None]
        first, second = self.V[edges.ends[cut]].transpose(1, 0, 2)
        points = [self.V, first * (1 - t) + second * t]
        sets = ((middles[edges.of] >= 0) * (1, 2, 4)).sum(axis=1)
        touched = np.flatnonzero(sets)
        nodes, local = self._nodes(touched, middles, places)
        central = [
            number
            for number, triangles in patterns.items()
            if any(MIDDLE in each for each in triangles)
        ]
        inner = np.flatnonzero(np.isin(sets[touched], central))
        nodes[inner, MIDDLE] = count + len(cut) + np.arange(len(inner))
        points.append(np.einsum("ij,ijk->ik", local[inner, MIDDLE], self.V[self.F[touched[inner]]]))
        whole = np.flatnonzero(sets == 0)
        F = [self.F[whole]]
        weights = [np.broadcast_to(np.eye(3), (len(whole), 3, 3))]
        origin = [whole]
        for number, triangles in patterns.items():
            chosen = np.flatnonzero(sets[touched] == number)
            for triangle in triangles:
                F.append(nodes[chosen][:, triangle])
                weights.append(local[chosen][:, triangle])
                origin.append(touched[chosen])
        source = np.concatenate(origin)
        share = np.concatenate(weights)
        parent = self.parent[source]
        inside = share @ self.inside[source]
        return (
            TriangleSurface(np.concatenate(points), np.concatenate(F), parent, inside),
            middles,
            source,
            share,
        )

    def _nodes(self, triangles: Ints, middles: Ints, places: Floats) -> tuple[Ints, Floats]:
        """Vertices [k, 7] and barycentrics [k, 7, 3] of the seven named points of triangles [k]."""
        nodes = np.full((len(triangles), 7), -1)
        local = np.zeros((len(triangles), 7, 3))
        nodes[:, :3] = self.F[triangles]
        local[:, :3] = np.eye(3)
        for k in range(3):
            edge = self.edges.of[triangles, k]
            nodes[:, 3 + k] = middles[edge]
            forward = self.edges.ends[edge, 0] == self.F[triangles, k]
            t = np.where(forward, places[edge], 1 - places[edge])
            local[:, 3 + k, k] = 1 - t
            local[:, 3 + k, (k + 1) % 3] = t
        corners = np.where(np.isnan(local[:, 3:6]), 0.0, local[:, 3:6]).sum(axis=1)
        local[:, MIDDLE] = corners / np.maximum(corners.sum(axis=1, keepdims=True), 1e-300)
        return nodes, local


@dataclasses.dataclass(frozen=True, eq=False)
class Flat:
    """Parts of a surface laid out in the plane.

    `part` [m] is that of each triangle, and `places` [m, 3, 2] are those of its corners.
    """

    surface: TriangleSurface
    part: Ints
    places: Floats


def central_vertices(flat: Flat, on_border: Bools) -> Ints:
    """The inner vertex nearest to the origin, one for each part."""
    distance = np.where(on_border[flat.surface.F], np.inf, (flat.places**2).sum(axis=2)).ravel()
    part = np.repeat(flat.part, 3)
    order = np.lexsort((distance, part))
    first = order[np.searchsorted(part[order], np.arange(flat.part.max() + 1))]
    return flat.surface.F.ravel()[first]


def cut_ray(flat: Flat, start: Ints, end: Ints, on_border: Bools) -> tuple[Flat, list[Ints]]:
    """Cut parts along a straight line each, from one of their vertices to one on their border.

    Parameters
    ----------
    start, end : int64 [parts]
        Vertices; -1 where a part is not to be cut.
    on_border : bool [n]

    Returns
    -------
    Flat
    list of int64 [l]
        The vertices along each line, from start to end.
    """
    chosen = start[flat.part] >= 0
    cut, source, paths = _cut_all(_subset(flat, chosen), start, end, on_border)
    # those that stay whole come first, in their old order
    is_whole = np.bincount(source, minlength=int(chosen.sum())) == 1
    kept = np.ones(len(chosen), bool)
    kept[np.flatnonzero(chosen)[~is_whole]] = False
    pieces = _subset(cut, ~is_whole[source])
    whole = _subset(flat, kept)
    surface = TriangleSurface(
        cut.surface.V,
        np.concatenate([whole.surface.F, pieces.surface.F]),
        np.concatenate([whole.surface.parent, pieces.surface.parent]),
        np.concatenate([whole.surface.inside, pieces.surface.inside]),
    )
    part = np.concatenate([whole.part, pieces.part])
    return Flat(surface, part, np.concatenate([whole.places, pieces.places])), paths


def _subset(flat: Flat, chosen: Bools) -> Flat:
    """Some of the triangles, with the vertices of all."""
    surface = flat.surface
    some = TriangleSurface(
        surface.V, surface.F[chosen], surface.parent[chosen], surface.inside[chosen]
    )
    return Flat(some, flat.part[chosen], flat.places[chosen])


def _cut_all(flat: Flat, start: Ints, end: Ints, on_border: Bools) -> tuple[Flat, Ints, list[Ints]]:
    """Cut parts that all have a line; see `cut_ray`.

    Returns the triangle from before in which each triangle lies, too.
    """
    surface = flat.surface
    origin = _place_of(flat, start)
    target = _place_of(flat, end)
    direction = (target - origin) / np.linalg.norm(target - origin, axis=1, keepdims=True)
    offset = flat.places - origin[flat.part][:, None]
    toward = direction[flat.part][:, None]
    reach = (offset * toward).sum(axis=2)
    beside = toward[..., 0] * offset[..., 1] - toward[..., 1] * offset[..., 0]
    ends_here = (start[flat.part][:, None] == surface.F) | (end[flat.part][:, None] == surface.F)
    on_ray = (np.abs(beside) < _MAX_OFF_RAY) & (reach > 0) & ~on_border[surface.F] | ends_here
    beside[on_ray] = 0.0
    sides = surface.edges.sides
    triangle, k = np.divmod(sides[:, 0], 3)
    p = beside[triangle, k]
    q = beside[triangle, (k + 1) % 3]
    crossed = (p * q < 0) & (sides[:, 1] >= 0)
    crossed &= flat.part[triangle] == flat.part[np.where(crossed, sides[:, 1], sides[:, 0]) // 3]
    t = np.where(crossed, p / np.where(crossed, p - q, 1.0), np.nan)
    distance = (1 - t) * reach[triangle, k] + t * reach[triangle, (k + 1) % 3]
    crossed &= distance > 0
    forward = surface.edges.ends[:, 0] == surface.F[triangle, k]
    finer, middles, source, weights = surface.subdivided(
        np.where(crossed, np.where(forward, t, 1 - t), np.nan)
    )
    touched, corner = np.nonzero(on_ray)
    at_vertices = np.stack([flat.part[touched], surface.F[touched, corner], reach[touched, corner]])
    on_edges = np.stack([flat.part[triangle[crossed]], middles[crossed], distance[crossed]])
    points = np.concatenate([at_vertices, on_edges], axis=1)
    # a point on a line is seen from all triangles beside it
    part, vertex = points[:2, np.lexsort((points[2], points[0]))].astype(np.int64)
    first = (np.diff(part, prepend=-1) != 0) | (np.diff(vertex, prepend=-1) != 0)
    paths = np.split(vertex[first], np.searchsorted(part[first], np.arange(1, len(start))))
    return Flat(finer, flat.part[source], weights @ flat.places[source]), source, paths


def _place_of(flat: Flat, vertex: Ints) -> Floats:
    """Places [parts, 2] of one vertex of each part; NaN where that is -1."""
    places = np.full((len(vertex), 2), np.nan)
    triangle, k = np.nonzero(vertex[flat.part][:, None] == flat.surface.F)
    places[flat.part[triangle]] = flat.places[triangle, k]
    return places


def halved_chords(
    surface: TriangleSurface, part: Ints, on_border: Bools
) -> tuple[TriangleSurface, Ints]:
    """Split chords: edges inside a part [m] both of whose ends lie on its border.

    In a flat polygon a chord could lie on a side.

    Returns the finer surface, and the triangle from before in which each of its triangles lies.
    """
    sides = surface.edges.sides
    inner = (sides >= 0).all(axis=1) & (part[sides[:, 0] // 3] == part[sides[:, 1] // 3])
    chords = inner & on_border[surface.edges.ends].all(axis=1)
    finer, _, origin, _ = surface.subdivided(np.where(chords, 0.5, np.nan))
    return finer, origin


def refined(surface: TriangleSurface, longest: float) -> TriangleSurface:
    """Split edges until none is longer than `longest` [m].

    The longest edge of a triangle goes first. A needle is split in both its long sides at once: the
    edge between their middles keeps ways across needles short, along which cells are measured.

    Where that would take too many triangles, longer ones are left.
    """
    most_triangles = max(_MAX_TRIANGLES, _MAX_TRIANGLE_GROWTH * len(surface.F))
    for _ in range(_MAX_REFINEMENTS):
        lengths = surface.edge_lengths
        sides = lengths[surface.edges.of]
        longest_side = sides.argmax(axis=1)
        longest_edge = np.take_along_axis(surface.edges.of, longest_side[:, None], axis=1)
        chosen = np.zeros(len(lengths), bool)
        chosen[longest_edge] = True
        is_needle = sides.min(axis=1) < _MAX_NEEDLE_WIDTH * sides.max(axis=1)
        is_long = sides > np.median(sides, axis=1, keepdims=True) * (1 - 1e-12)
        chosen[surface.edges.of[is_needle[:, None] & is_long]] = True
        chosen &= lengths > longest
        if not chosen.any() or len(surface.F) > most_triangles:
            break
        surface = surface.subdivided(np.where(chosen, 0.5, np.nan))[0]
    return surface
