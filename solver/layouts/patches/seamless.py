"""A map onto charts that knows no borders: its vertices may move from one chart to the next.

Each vertex has a place in the frame of its chart, the complex number column + i row, both from 0 to
1. Each triangle has a frame too, that of the chart where it lay first, continued beyond that
chart's border; a turn by right angles and a whole shift take the places of its corners there. Where
other than four charts meet, the surface of all charts has the tip of a cone: there sits a fixed
vertex, so that every triangle is flat. A map without a folded triangle is then one to one: it winds
once round each tip, and covers each chart once.

A change from one frame to another is a turn by right angles, counter-clockwise, then a whole shift.
A vertex that leaves its chart takes place and frame of the chart that it enters.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...kernel import Ints, kernel, shared
from ...mesh.topology import counting_sort
from ..energy import COLUMN, FIXED, FREE, ROW
from .charts import CORNERS
from .quads import Quads

Complex: TypeAlias = NDArray[np.complex128]

Frame: TypeAlias = tuple[int, complex]  # turn and shift

# The change from a frame to itself.
_OWN_FRAME = 0, 0j

# The factor of a vector for each turn by right angles.
_TURNS = np.array([1, 1j, -1, -1j])

# Charts that a straight way may cross.
_MAX_CHARTS_CROSSED = 64


@kernel
def turned(z: complex, turn: int) -> complex:
    """A vector after a turn: i^turn z."""
    if turn == 0:
        return z
    if turn == 2:
        return -z
    left = complex(-z.imag, z.real)
    return left if turn == 1 else -left


@kernel
def after(first: Frame, second: Frame) -> Frame:
    """Two changes, one after the other."""
    return (first[0] + second[0]) % 4, turned(first[1], second[0]) + second[1]


@kernel
def inverse(frame: Frame) -> Frame:
    """The change back."""
    back = (4 - frame[0]) % 4
    return back, -turned(frame[1], back)


@shared
def wedge(u: Any, v: Any) -> Any:
    """Double area of the triangle between two vectors, positive where v lies on the left of u."""
    return u.real * v.imag - u.imag * v.real


@shared
def square(u: Any) -> Any:
    """Squared length of a vector."""
    return u.real * u.real + u.imag * u.imag


class SeamlessMap(NamedTuple):
    """Places of vertices on charts, and how triangles see them."""

    F: Ints  # triangles, [m, 3]
    frame: Ints  # the chart whose frame is that of each triangle, [m]
    chart: Ints  # the chart in which each vertex lies, [n]
    z: Complex  # the place of each vertex in its chart, [n]
    freedom: Ints  # in which directions each vertex may move, [n]
    turn: Ints  # right angles from the frame of each corner's vertex to the triangle's, [m, 3]
    shift: Complex  # the shift after that turn, [m, 3]
    glued: Ints  # the chart and its side beyond each side of every chart; -1: a rim, [C, 4, 2]
    side_turn: Ints  # right angles from the frame of each chart to that beyond each side, [C, 4]
    side_shift: Complex  # the shift after that turn, [C, 4]
    star_start: Ints  # where the corners of each vertex begin, [n + 1]
    star: Ints  # corners 3 triangle + k, by vertex, [3 m]


def seamless_map(quads: Quads) -> SeamlessMap:
    """The map that the quads begin with."""
    surface = quads.surface
    F = surface.F
    count = len(surface.V)
    twin = np.full(3 * len(F), -1)
    joined = surface.edges.sides[~surface.edges.rim]
    twin[joined] = joined[:, ::-1]
    # across glued sides: side s of one chart runs against side t of the other
    here = np.arange(4)
    there = quads.glued[..., 1]
    corners = CORNERS @ (1, 1j)
    side_turn = (there + 2 - here) % 4
    side_shift = corners[(there + 1) % 4] - _TURNS[side_turn] * corners[here]
    star_start, star = stars(F, count)
    seamless = SeamlessMap(
        F=F,
        frame=quads.chart,
        chart=np.zeros(count, np.int64),
        z=np.zeros(count, np.complex128),
        freedom=np.full(count, FREE),
        turn=np.zeros(F.shape, np.int64),
        shift=np.zeros(F.shape, np.complex128),
        glued=quads.glued,
        side_turn=side_turn,
        side_shift=side_shift,
        star_start=star_start,
        star=star,
    )
    _connect(seamless, twin, quads.places[..., 0] + 1j * quads.places[..., 1])
    return seamless


def stars(F: Ints, count: int) -> tuple[Ints, Ints]:
    """Corners 3 triangle + k of the triangles F [m, 3], sorted by vertex.

    Returns where the corners of each vertex begin [n + 1], and all corners [3 m].
    """
    return counting_sort(F.ravel(), np.arange(F.size), count)


@kernel
def frame_of(seamless: SeamlessMap, f: int, k: int) -> Frame:
    """Change from the frame of corner k of triangle f to the frame of the triangle."""
    return seamless.turn[f, k], seamless.shift[f, k]


@kernel
def corner_place(seamless: SeamlessMap, f: int, k: int) -> complex:
    """Place of corner k of triangle f in the triangle's frame."""
    return turned(seamless.z[seamless.F[f, k]], seamless.turn[f, k]) + seamless.shift[f, k]


@kernel
def place_seen_from(seamless: SeamlessMap, f: int, k: int, j: int) -> complex:
    """Place of corner j of triangle f, in the frame of the vertex at its corner k."""
    back = (4 - seamless.turn[f, k]) % 4
    return turned(corner_place(seamless, f, j) - seamless.shift[f, k], back)


def corner_places(seamless: SeamlessMap) -> Complex:
    """Places [m, 3] of the corners of all triangles in these triangles' frames."""
    return _TURNS[seamless.turn] * seamless.z[seamless.F] + seamless.shift


def places_seen_from(seamless: SeamlessMap, triangles: Ints, corner: Ints) -> tuple[Ints, Complex]:
    """Chart [k] in which a corner [k] of each triangle [k] lies, and all corners' places there.

    The places [k, 3] are in the frame of that chart.
    """
    offset = corner_places(seamless)[triangles] - seamless.shift[triangles, corner][:, None]
    places = _TURNS[seamless.turn[triangles, corner]].conj()[:, None] * offset
    return seamless.chart[seamless.F[triangles, corner]], places


def places_on_charts(seamless: SeamlessMap) -> tuple[Ints, Ints, Complex]:
    """First corner of each triangle that is not a cone's tip, its chart, and all places there.

    Such a corner lies in one chart. Returns these corners [m], charts [m], and the places [m, 3] of
    all corners there.
    """
    free = seamless.freedom[seamless.F] != FIXED
    corner = np.where(free.any(axis=1), free.argmax(axis=1), 2)
    return corner, *places_seen_from(seamless, np.arange(len(corner)), corner)


@kernel
def _side_of(a: complex, b: complex, glued: Ints, other: int) -> int:
    """The side of a chart on which two places lie, with another chart beyond it (-1: a rim)."""
    for side in range(4):
        p, q = (a.imag, b.imag) if side % 2 == 0 else (a.real, b.real)
        if p == q == (1.0 if side == 1 or side == 2 else 0.0) and glued[side, 0] == other:
            return side
    return -1


@kernel
def _connect(seamless: SeamlessMap, twin: Ints, places: Complex) -> None:
    """Go round each vertex and fill in its place, its freedom, and the frames of its corners."""
    chart = seamless.frame
    for v in range(len(seamless.z)):
        first = h = seamless.star[seamless.star_start[v]]
        while twin[h] >= 0:  # clockwise to the rim, if there is one
            t = twin[h]
            h = t + 1 if t % 3 < 2 else t - 2
            if h == first:
                break
        first = h
        at_rim = twin[h] < 0
        frame = _OWN_FRAME
        crossed = 0
        place = places[h // 3, h % 3]
        seamless.chart[v] = chart[h // 3]
        seamless.z[v] = place
        while True:  # counter-clockwise, from one chart to the next
            f = h // 3
            k = h % 3
            seamless.turn[f, k], seamless.shift[f, k] = frame
            before = h + 2 if k == 0 else h - 1
            t = twin[before]
            if t < 0:
                break
            if chart[t // 3] != chart[f]:
                c = chart[f]
                side = _side_of(
                    places[f, k], places[f, before % 3], seamless.glued[c], chart[t // 3]
                )
                frame = after(frame, (seamless.side_turn[c, side], seamless.side_shift[c, side]))
                crossed += 1
            h = t
            if h == first:
                break
        if at_rim:
            f = first // 3
            k = first % 3
            side = _side_of(places[f, k], places[f, (k + 1) % 3], seamless.glued[chart[f]], -1)
            seamless.freedom[v] = COLUMN if side % 2 == 0 else ROW
        corner = (place.real == 0 or place.real == 1) and (place.imag == 0 or place.imag == 1)
        if corner and crossed != (1 if at_rim else 4):  # the tip of a cone
            seamless.freedom[v] = FIXED
            seamless.z[v] = 0.0
            for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
                f = seamless.star[i] // 3
                k = seamless.star[i] % 3
                seamless.turn[f, k] = 0
                seamless.shift[f, k] = places[f, k]


@kernel
def _lies_inside(z: complex) -> bool:
    """Whether a place lies in its chart."""
    return 0.0 <= z.real <= 1.0 and 0.0 <= z.imag <= 1.0


@kernel
def rehome(seamless: SeamlessMap, before: Complex) -> None:
    """Follow each vertex straight from where it was [n], over the borders of charts."""
    for v in range(len(seamless.z)):
        if seamless.freedom[v] != FIXED and not _lies_inside(seamless.z[v]):
            rehome_vertex(seamless, v, before[v])


@kernel
def rehome_vertex(seamless: SeamlessMap, v: int, p: complex) -> None:
    """Follow one vertex from p, in its chart."""
    q = seamless.z[v]
    if _lies_inside(q):
        return
    seamless.chart[v], change, seamless.z[v] = follow(seamless, seamless.chart[v], p, q)
    if change[0] % 2 == 1 and seamless.freedom[v] != FREE:
        seamless.freedom[v] = COLUMN + ROW - seamless.freedom[v]
    back = inverse(change)
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        seamless.turn[f, k], seamless.shift[f, k] = after(back, frame_of(seamless, f, k))


@kernel
def follow(seamless: SeamlessMap, chart: int, p: complex, q: complex) -> tuple[int, Frame, complex]:
    """Go straight from p, in a chart, to q, given in the frame of that chart.

    Returns the chart in which q lies, the change of frames on the way, and q in that chart.
    """
    change = _OWN_FRAME
    came = -1
    for _ in range(_MAX_CHARTS_CROSSED):
        # the side through which the way leaves the square
        side = -1
        least = 1.0
        if q.imag < 0.0 and came != 0 and p.imag / (p.imag - q.imag) < least:
            side = 0
            least = p.imag / (p.imag - q.imag)
        if q.real > 1.0 and came != 1 and (1.0 - p.real) / (q.real - p.real) < least:
            side = 1
            least = (1.0 - p.real) / (q.real - p.real)
        if q.imag > 1.0 and came != 2 and (1.0 - p.imag) / (q.imag - p.imag) < least:
            side = 2
            least = (1.0 - p.imag) / (q.imag - p.imag)
        if q.real < 0.0 and came != 3 and p.real / (p.real - q.real) < least:
            side = 3
            least = p.real / (p.real - q.real)
        if side < 0 or seamless.glued[chart, side, 0] < 0:
            break
        turn = seamless.side_turn[chart, side]
        shift = seamless.side_shift[chart, side]
        p = turned(p, turn) + shift
        q = turned(q, turn) + shift
        change = after(change, (turn, shift))
        chart, came = seamless.glued[chart, side]
    return chart, change, q
