"""The triangles of a mesh, cut into smaller ones that know where they came from.

Edges are cut in the middle, if they are long or join two points of a border. Flat polygons are cut
along straight lines, from their middles to the middles of their sides. Cells are cut apart along
their borders (see `cells`).
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints
from ...mesh.topology import SPLITS, Edges, corner_angles, edges_of, triangle_areas

# The points of a triangle abc that is cut: its corners, a point on each of its sides, and one
# inside.
A, B, C, AB, BC, CA, MIDDLE = range(7)

# How to cut triangles. For each set of cut sides (1 for ab, 2 for bc, 4 for ca, added up) the
# triangles that take the place of the triangle, each as three of the seven points. See `SPLITS`.
Patterns = Mapping[int, Sequence[Sequence[int]]]

# Numbers of the sides ab, bc, ca in a set of cut sides.
_SIDE_BITS = (1, 2, 4)

# Distance from a line up to which a vertex lies on it, in units of a polygon's radius.
_MAX_OFF_LINE = 1e-9

# Shortest side over longest side of a needle, at most.
_MAX_NEEDLE_WIDTH = 0.125

# Sides longer than the median side less this share count as the long sides of a needle: a needle
# with two equal sides has both of them.
_LONG_SIDE_ROUNDOFF = 1e-12

# Passes that split long edges, at most.
_MAX_REFINEMENTS = 100

# Triangles above which a part is not refined any more.
_MAX_TRIANGLES = 20_000

# A part that has many triangles to begin with may get up to this many times as many.
_MAX_TRIANGLE_GROWTH = 2

# Keeps quotients by a sum of weights finite.
_TINY = 1e-300


@dataclasses.dataclass(frozen=True, eq=False)
class TriangleSurface:
    """Triangles that cover a mesh; each lies in one of the mesh's triangles, its parent.

    Attributes
    ----------
    V : float64 [n, 3]
        Points [m].
    F : int64 [m, 3]
    parent : int64 [m]
        Triangle of the mesh in which each triangle lies.
    inside : float64 [m, 3, 3]
        Barycentric coordinates in the parent, of the three corners.
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

    def subdivided(self, places: Floats, patterns: Patterns = SPLITS) -> Subdivision:
        """Cut edges, and the triangles beside them.

        The first vertices of the new surface are those of this one.

        Parameters
        ----------
        places : float64 [e]
            Where each edge is cut, between 0 at its first end and 1; NaN where it is not.
        patterns : dict, optional
            How to cut triangles. Their pieces come in the order of this dictionary, after the
            triangles that stay whole.
        """
        edges = self.edges
        vertex_count = len(self.V)
        cut_edges = np.flatnonzero(~np.isnan(places))
        middles = np.full(len(edges.ends), -1)
        middles[cut_edges] = vertex_count + np.arange(len(cut_edges))
        t = places[cut_edges][:, None]
        first, second = self.V[edges.ends[cut_edges]].transpose(1, 0, 2)
        points_on_edges = first * (1 - t) + second * t

        cut_sides = ((middles[edges.of_side] >= 0) * _SIDE_BITS).sum(axis=1)
        cut_triangles = np.flatnonzero(cut_sides)
        cut_sides_there = cut_sides[cut_triangles]
        nodes, barycentrics = self._nodes(cut_triangles, middles, places)
        with_middle = np.flatnonzero(np.isin(cut_sides_there, _sets_with_middle(patterns)))
        nodes[with_middle, MIDDLE] = vertex_count + len(cut_edges) + np.arange(len(with_middle))
        corners = self.V[self.F[cut_triangles[with_middle]]]
        points_inside = np.einsum("ij,ijk->ik", barycentrics[with_middle, MIDDLE], corners)

        whole = np.flatnonzero(cut_sides == 0)
        F = [self.F[whole]]
        weights = [np.broadcast_to(np.eye(3), (len(whole), 3, 3))]
        origin = [whole]
        for sides, triangles in patterns.items():
            chosen = np.flatnonzero(cut_sides_there == sides)
            for triangle in triangles:
                F.append(nodes[chosen][:, triangle])
                weights.append(barycentrics[chosen][:, triangle])
                origin.append(cut_triangles[chosen])
        all_origins = np.concatenate(origin)
        all_weights = np.concatenate(weights)
        surface = TriangleSurface(
            V=np.concatenate([self.V, points_on_edges, points_inside]),
            F=np.concatenate(F),
            parent=self.parent[all_origins],
            inside=all_weights @ self.inside[all_origins],
        )
        return Subdivision(surface, middles, all_origins, all_weights)

    def _nodes(self, triangles: Ints, middles: Ints, places: Floats) -> tuple[Ints, Floats]:
        """The seven points A to MIDDLE of triangles [k]; see `subdivided`.

        Returns their vertices [k, 7], which are -1 for MIDDLE and on sides that are not cut, and
        their barycentric coordinates [k, 7, 3]. MIDDLE is the mean of the points on the sides.
        """
        nodes = np.full((len(triangles), 7), -1)
        barycentrics = np.zeros((len(triangles), 7, 3))
        nodes[:, :3] = self.F[triangles]
        barycentrics[:, :3] = np.eye(3)
        for k in range(3):
            edge = self.edges.of_side[triangles, k]
            nodes[:, 3 + k] = middles[edge]
            runs_forwards = self.edges.ends[edge, 0] == self.F[triangles, k]
            t = np.where(runs_forwards, places[edge], 1 - places[edge])
            barycentrics[:, 3 + k, k] = 1 - t
            barycentrics[:, 3 + k, (k + 1) % 3] = t
        on_sides = barycentrics[:, AB : CA + 1]
        weights = np.where(np.isnan(on_sides), 0.0, on_sides).sum(axis=1)
        total = np.maximum(weights.sum(axis=1, keepdims=True), _TINY)
        barycentrics[:, MIDDLE] = weights / total
        return nodes, barycentrics


class Subdivision(NamedTuple):
    """A surface that was cut into smaller triangles, and where they came from."""

    surface: TriangleSurface  # the new surface
    middles: Ints  # its vertex on each old edge; -1 where the edge was not cut, [e]
    origin: Ints  # the old triangle in which each of its triangles lies, [m]
    weights: Floats  # barycentric coordinates in the old triangle, of the corners, [m, 3, 3]


def _sets_with_middle(patterns: Patterns) -> list[int]:
    """The sets of cut sides for which a triangle gets a point inside."""
    sets = []
    for sides, triangles in patterns.items():
        if any(MIDDLE in triangle for triangle in triangles):
            sets.append(sides)
    return sets


@dataclasses.dataclass(frozen=True, eq=False)
class Flat:
    """Polygons: parts of a surface laid out in the plane.

    Attributes
    ----------
    surface : TriangleSurface
    part : int64 [m]
        The polygon to which each triangle belongs.
    places : float64 [m, 3, 2]
        Coordinates in the plane of the corners, in units of a polygon's radius.
    """

    surface: TriangleSurface
    part: Ints
    places: Floats


def central_vertices(flat: Flat, on_border: Bools) -> Ints:
    """The inner vertex nearest to the origin, for each polygon; `on_border` [n] are not inner."""
    squared_distance = (flat.places**2).sum(axis=2)
    distance = np.where(on_border[flat.surface.F], np.inf, squared_distance).ravel()
    part = np.repeat(flat.part, 3)
    order = np.lexsort((distance, part))
    first = order[np.searchsorted(part[order], np.arange(flat.part.max() + 1))]
    return flat.surface.F.ravel()[first]


def cut_ray(flat: Flat, start: Ints, end: Ints, on_border: Bools) -> tuple[Flat, list[Ints]]:
    """Cut polygons along a straight line each, from an inner vertex to a vertex on the border.

    Parameters
    ----------
    start, end : int64 [parts]
        Vertices; -1 where a polygon is not to be cut.
    on_border : bool [n]

    Returns
    -------
    Flat
        Triangles that stay whole come first, in their old order.
    list of int64 [l]
        The vertices along each line, from start to end.
    """
    has_line = np.flatnonzero(start[flat.part] >= 0)
    line = _line_coordinates(_subset(flat, has_line), start, end, on_border)
    is_near = _is_near(line)
    near = has_line[is_near]
    coordinates = _LineCoordinates._make(array[is_near] for array in line)
    cut, origin, paths = _cut_all(_subset(flat, near), coordinates, len(start))
    stays_whole = np.bincount(origin, minlength=len(near)) == 1
    is_whole = np.ones(len(flat.part), bool)
    is_whole[near[~stays_whole]] = False
    whole = _subset(flat, is_whole)
    pieces = _subset(cut, ~stays_whole[origin])
    surface = TriangleSurface(
        V=cut.surface.V,
        F=np.concatenate([whole.surface.F, pieces.surface.F]),
        parent=np.concatenate([whole.surface.parent, pieces.surface.parent]),
        inside=np.concatenate([whole.surface.inside, pieces.surface.inside]),
    )
    part = np.concatenate([whole.part, pieces.part])
    places = np.concatenate([whole.places, pieces.places])
    return Flat(surface, part, places), paths


def _subset(flat: Flat, chosen: Bools | Ints) -> Flat:
    """Some of the triangles, with the vertices of all."""
    surface = flat.surface
    some = TriangleSurface(
        surface.V, surface.F[chosen], surface.parent[chosen], surface.inside[chosen]
    )
    return Flat(some, flat.part[chosen], flat.places[chosen])


class _LineCoordinates(NamedTuple):
    """Where the corners of triangles lie, seen along the line of their polygon."""

    along: Floats  # distance from the line's start along it, [m, 3]
    beside: Floats  # on which side of the line; 0 where the corner is on it, [m, 3]
    on_line: Bools  # the corners that lie on the line, [m, 3]


class _Crossings(NamedTuple):
    """The edges of a surface that lines cross between their ends."""

    crossed: Bools  # [e]
    places: Floats  # where each edge is cut, as in `TriangleSurface.subdivided`, [e]
    along: Floats  # distance of that point from the line's start, [e]


def _is_near(line: _LineCoordinates) -> Bools:
    """Triangles that their line may cut, [m]: with corners on both sides of it, or on it."""
    lies_across = (line.beside.min(axis=1) < 0) & (line.beside.max(axis=1) > 0)
    lies_after_start = line.along.max(axis=1) > 0
    return (lies_across & lies_after_start) | line.on_line.any(axis=1)


def _cut_all(flat: Flat, line: _LineCoordinates, count: int) -> tuple[Flat, Ints, list[Ints]]:
    """Cut the triangles near the lines of a number of polygons; see `cut_ray`.

    Returns the triangle from before in which each triangle lies, too.
    """
    surface = flat.surface
    crossings = _crossings(flat, line)
    finer, middles, origin, weights = surface.subdivided(crossings.places)
    triangle, corner = np.nonzero(line.on_line)
    at_vertices = np.stack(
        [flat.part[triangle], surface.F[triangle, corner], line.along[triangle, corner]]
    )
    crossed = crossings.crossed
    on_edges = np.stack(
        [
            flat.part[surface.edges.sides[crossed, 0] // 3],
            middles[crossed],
            crossings.along[crossed],
        ]
    )
    points = np.concatenate([at_vertices, on_edges], axis=1)
    paths = _paths(points, count)
    places = weights @ flat.places[origin]
    return Flat(finer, flat.part[origin], places), origin, paths


def _line_coordinates(flat: Flat, start: Ints, end: Ints, on_border: Bools) -> _LineCoordinates:
    """Coordinates along the lines from start to end, one for each polygon."""
    F = flat.surface.F
    start_place = _place_of(flat, start)
    way = _place_of(flat, end) - start_place
    direction = way / np.linalg.norm(way, axis=1, keepdims=True)
    offset = flat.places - start_place[flat.part][:, None]
    toward = direction[flat.part][:, None]
    along = (offset * toward).sum(axis=2)
    beside = toward[..., 0] * offset[..., 1] - toward[..., 1] * offset[..., 0]
    is_start = start[flat.part][:, None] == F
    is_end = end[flat.part][:, None] == F
    is_between = (np.abs(beside) < _MAX_OFF_LINE) & (along > 0) & ~on_border[F]
    on_line = is_between | is_start | is_end
    beside[on_line] = 0.0
    return _LineCoordinates(along, beside, on_line)


def _crossings(flat: Flat, line: _LineCoordinates) -> _Crossings:
    """The edges inside polygons that the lines cross, after their start."""
    surface = flat.surface
    sides = surface.edges.sides
    triangle, k = np.divmod(sides[:, 0], 3)
    following = (k + 1) % 3
    p = line.beside[triangle, k]
    q = line.beside[triangle, following]
    crossed = (p * q < 0) & (sides[:, 1] >= 0)
    other_triangle = np.where(crossed, sides[:, 1], sides[:, 0]) // 3
    crossed &= flat.part[triangle] == flat.part[other_triangle]
    t = np.where(crossed, p / np.where(crossed, p - q, 1.0), np.nan)
    along = (1 - t) * line.along[triangle, k] + t * line.along[triangle, following]
    crossed &= along > 0
    runs_forwards = surface.edges.ends[:, 0] == surface.F[triangle, k]
    places = np.where(crossed, np.where(runs_forwards, t, 1 - t), np.nan)
    return _Crossings(crossed, places, along)


def _paths(points: Floats, count: int) -> list[Ints]:
    """The vertices along each of `count` lines, in order.

    Points [3, k] have the number of their line, their vertex, and their distance from the line's
    start. A point comes once for each triangle beside it.
    """
    order = np.lexsort((points[2], points[0]))
    line, vertex = points[:2, order].astype(np.int64)
    is_first = (np.diff(line, prepend=-1) != 0) | (np.diff(vertex, prepend=-1) != 0)
    starts = np.searchsorted(line[is_first], np.arange(1, count))
    return np.split(vertex[is_first], starts)


def _place_of(flat: Flat, vertex: Ints) -> Floats:
    """Places [parts, 2] of a vertex of each polygon [parts]; NaN where the vertex is -1."""
    places = np.full((len(vertex), 2), np.nan)
    triangle, k = np.nonzero(vertex[flat.part][:, None] == flat.surface.F)
    places[flat.part[triangle]] = flat.places[triangle, k]
    return places


def halved_chords(
    surface: TriangleSurface, part: Ints, on_border: Bools
) -> tuple[TriangleSurface, Ints]:
    """Split chords: edges inside a part both of whose ends lie on the border of the part.

    In a flat polygon a chord could lie on a side. `part` [m] is the part of each triangle, and
    `on_border` [n] are the vertices on borders.

    Returns the finer surface, and the triangle from before in which each of its triangles lies.
    """
    sides = surface.edges.sides
    has_two_triangles = (sides >= 0).all(axis=1)
    is_inner = has_two_triangles & (part[sides[:, 0] // 3] == part[sides[:, 1] // 3])
    is_chord = is_inner & on_border[surface.edges.ends].all(axis=1)
    finer, _, origin, _ = surface.subdivided(np.where(is_chord, 0.5, np.nan))
    return finer, origin


def refined(surface: TriangleSurface, longest: float) -> TriangleSurface:
    """Split edges until none is longer than `longest` [m], or there are too many triangles.

    The longest edge of a triangle goes first. A needle is split in both its long sides at once: the
    edge between their middles keeps ways across needles short, along which cells are measured.
    """
    most_triangles = max(_MAX_TRIANGLES, _MAX_TRIANGLE_GROWTH * len(surface.F))
    for _ in range(_MAX_REFINEMENTS):
        lengths = surface.edge_lengths
        edge_of_side = surface.edges.of_side
        sides = lengths[edge_of_side]
        longest_side = sides.argmax(axis=1)
        longest_edge = np.take_along_axis(edge_of_side, longest_side[:, None], axis=1)
        is_needle = sides.min(axis=1) < _MAX_NEEDLE_WIDTH * sides.max(axis=1)
        median_side = np.median(sides, axis=1, keepdims=True)
        is_long_side = sides > median_side * (1 - _LONG_SIDE_ROUNDOFF)
        to_split = np.zeros(len(lengths), bool)
        to_split[longest_edge] = True
        to_split[edge_of_side[is_needle[:, None] & is_long_side]] = True
        to_split &= lengths > longest
        if not to_split.any() or len(surface.F) > most_triangles:
            break
        surface = surface.subdivided(np.where(to_split, 0.5, np.nan)).surface
    return surface
