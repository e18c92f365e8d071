"""A map onto charts that knows no borders: its vertices may move from one chart to the next.

Each vertex has a place in the frame of its chart, (column, row) from 0 to 1. Each triangle has a frame too, that of the
chart where it lay first, continued beyond that chart's border; a turn by right angles and a whole shift take the places
of its corners there. Where other than four charts meet, the surface of all charts has the tip of a cone: there sits a
fixed vertex, so that every triangle is flat. A map without a folded triangle is then one to one: it winds once round
each tip, and covers each chart once.

A change from one frame to another is a turn by right angles, counter-clockwise, then a whole shift. A vertex that
leaves its chart takes place and frame of the chart that it enters.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from ...kernel import Floats, Ints, kernel
from ...mesh.topology import counting_sort
from ..energy import COLUMN, FIXED, FREE, ROW
from .charts import CORNERS
from .quads import Quads

# turn, and shift along columns and rows
Frame: TypeAlias = tuple[int, int, int]
# turned vectors stay whole where they are
Number = TypeVar("Number", int, float)


@kernel
def turned(x: Number, y: Number, turn: int) -> tuple[Number, Number]:
    """A vector after a turn."""
    if turn == 0:
        return x, y
    if turn == 1:
        return -y, x
    if turn == 2:
        return -x, -y
    return y, -x


@kernel
def after(first: Frame, second: Frame) -> Frame:
    """Two changes, one after the other."""
    x, y = turned(first[1], first[2], second[0])
    return (first[0] + second[0]) % 4, x + second[1], y + second[2]


@kernel
def inverse(frame: Frame) -> Frame:
    """The change back."""
    back = (4 - frame[0]) % 4
    x, y = turned(-frame[1], -frame[2], back)
    return back, x, y


# what a vector [2] is multiplied with for each turn
_TURNS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])


class SeamlessMap(NamedTuple):
    """Places of vertices on charts, and how triangles see them."""

    F: Ints  # [m, 3]
    frame: Ints  # [m], the chart whose frame is that of each triangle
    chart: Ints  # [n], in which each vertex lies
    x: Floats  # [n, 2], its place there
    freedom: Ints  # [n]
    turn: Ints  # [m, 3], right angles from the vertex's frame to the triangle's
    shift: Ints  # [m, 3, 2], after that
    glued: Ints  # [C, 4, 2]
    side_turn: Ints  # [C, 4], from the frame of each chart to that of the chart beyond each of its sides
    side_shift: Ints  # [C, 4, 2], after that
    star_start: Ints  # [n + 1], where the corners of each vertex begin
    star: Ints  # [3 m], corners 3 triangle + k by vertex


def seamless_map(quads: Quads) -> SeamlessMap:
    """The map that the quads begin with."""
    surface = quads.surface
    F, count = surface.F, len(surface.V)
    twin = np.full(3 * len(F), -1)
    sides = surface.edges.sides
    joined = sides[:, 1] >= 0
    twin[sides[joined, 0]], twin[sides[joined, 1]] = sides[joined, 1], sides[joined, 0]
    star_start, star = stars(F, count)
    seamless = SeamlessMap(
        F,
        quads.chart,
        np.zeros(count, np.int64),
        np.zeros((count, 2)),
        np.full(count, FREE),
        np.zeros((len(F), 3), np.int64),
        np.zeros((len(F), 3, 2), np.int64),
        quads.glued,
        *_transitions(quads.glued),
        star_start,
        star,
    )
    _connect(seamless, twin, np.ascontiguousarray(quads.places))
    return seamless


def stars(F: Ints, count: int) -> tuple[Ints, Ints]:
    """Corners 3 triangle + k of the triangles F [m, 3] by vertex: where those of each begin [n + 1], and all [3 m]."""
    return counting_sort(F.ravel(), np.arange(F.size), count)


def _transitions(glued: Ints) -> tuple[Ints, Ints]:
    """Frame changes across glued sides, a turn and a shift; side s of one chart runs against side t of the other."""
    here, there = np.arange(4), glued[..., 1]
    turn = (there + 2 - here) % 4
    return turn, CORNERS[(there + 1) % 4] - np.einsum("csij,sj->csi", _TURNS[turn], CORNERS[here])


@kernel
def frame_of(seamless: SeamlessMap, f: int, k: int) -> Frame:
    """Change from the frame of corner k of triangle f to that of the triangle."""
    return seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1]


@kernel
def corner_place(seamless: SeamlessMap, f: int, k: int) -> tuple[float, float]:
    """Place of corner k of triangle f in the triangle's frame."""
    v = seamless.F[f, k]
    x, y = turned(seamless.x[v, 0], seamless.x[v, 1], seamless.turn[f, k])
    return x + seamless.shift[f, k, 0], y + seamless.shift[f, k, 1]


def corner_places(seamless: SeamlessMap) -> Floats:
    """Places [m, 3, 2] of the corners of all triangles in these triangles' frames."""
    return np.einsum("fkij,fkj->fki", _TURNS[seamless.turn], seamless.x[seamless.F]) + seamless.shift


def places_seen_from(seamless: SeamlessMap, triangles: Ints, corner: Ints) -> tuple[Ints, Floats]:
    """Chart in which a corner [k] of each of some triangles [k] lies, and the places of all three in its frame."""
    offset = corner_places(seamless)[triangles] - seamless.shift[triangles, corner][:, None]
    places = np.einsum("fij,fkj->fki", _TURNS[(4 - seamless.turn[triangles, corner]) % 4], offset)
    return seamless.chart[seamless.F[triangles, corner]], places


def places_on_charts(seamless: SeamlessMap) -> tuple[Ints, Ints, Floats]:
    """First corner of each triangle that sits on no cone's tip: it knows in which chart it lies; see above.

    Returns these corners [m], charts [m], and the places [m, 3, 2] of all corners there.
    """
    free = seamless.freedom[seamless.F] != FIXED
    corner = np.where(free.any(axis=1), free.argmax(axis=1), 2)
    return corner, *places_seen_from(seamless, np.arange(len(corner)), corner)


@kernel
def _side_of(a: Floats, b: Floats, glued: Ints, other: int) -> int:
    """The side of a chart on which two places lie and beyond which lies another chart (-1: a rim)."""
    for side in range(4):
        axis, value = 1 - side % 2, 1.0 if side == 1 or side == 2 else 0.0
        if a[axis] == value and b[axis] == value and glued[side, 0] == other:
            return side
    return -1


@kernel
def _connect(seamless: SeamlessMap, twin: Ints, places: Floats) -> None:
    """Go round each vertex and fill in its place, its freedom, and the frames of its corners."""
    for v in range(len(seamless.x)):
        first = seamless.star[seamless.star_start[v]]
        h, at_rim = first, False
        while True:  # clockwise to the rim, if there is one
            if twin[h] < 0:
                at_rim = True
                break
            t = twin[h]
            h = t + 1 if t % 3 < 2 else t - 2
            if h == first:
                break
        _go_round(seamless, twin, places, v, h, at_rim)


@kernel
def _go_round(seamless: SeamlessMap, twin: Ints, places: Floats, v: int, h: int, at_rim: bool) -> None:
    """Fill in a vertex and its corners, counter-clockwise from corner h, the first one at a rim."""
    first, chart = h, seamless.frame
    turn, sx, sy, crossed = 0, 0, 0, 0
    seamless.chart[v] = chart[h // 3]
    seamless.x[v, 0], seamless.x[v, 1] = x, y = places[h // 3, h % 3, 0], places[h // 3, h % 3, 1]
    while True:
        f, k = h // 3, h % 3
        seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1] = turn, sx, sy
        before = h + 2 if k == 0 else h - 1
        t = twin[before]
        if t < 0:
            break
        if chart[t // 3] != chart[f]:
            c = chart[f]
            side = _side_of(places[f, k], places[f, before % 3], seamless.glued[c], chart[t // 3])
            tx, ty = turned(float(sx), float(sy), seamless.side_turn[c, side])
            sx, sy = int(tx) + seamless.side_shift[c, side, 0], int(ty) + seamless.side_shift[c, side, 1]
            turn = (turn + seamless.side_turn[c, side]) % 4
            crossed += 1
        h = t
        if h == first:
            break
    corner = (x == 0 or x == 1) and (y == 0 or y == 1)
    cone = corner and crossed != (1 if at_rim else 4)
    if at_rim:
        f, k = first // 3, first % 3
        side = _side_of(places[f, k], places[f, (k + 1) % 3], seamless.glued[chart[f]], -1)
        seamless.freedom[v] = COLUMN if side % 2 == 0 else ROW
    if not cone:
        return
    seamless.freedom[v] = FIXED
    seamless.x[v, 0] = seamless.x[v, 1] = 0.0
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        seamless.turn[f, k] = 0
        for j in range(2):
            seamless.shift[f, k, j] = int(places[f, k, j])


_MOST_CHARTS = 64


@kernel
def rehome(seamless: SeamlessMap, before: Floats) -> None:
    """Follow each vertex from where it was [n, 2], straight to where it is, over the borders of charts."""
    for v in range(len(seamless.x)):
        if seamless.freedom[v] != FIXED:
            rehome_vertex(seamless, v, before[v, 0], before[v, 1])


@kernel
def rehome_vertex(seamless: SeamlessMap, v: int, px: float, py: float) -> None:
    """Follow one vertex from p, in its chart."""
    qx, qy = seamless.x[v, 0], seamless.x[v, 1]
    if 0.0 <= qx <= 1.0 and 0.0 <= qy <= 1.0:
        return
    chart, turn, sx, sy, x, y = follow(seamless, seamless.chart[v], px, py, qx, qy)
    seamless.chart[v], seamless.x[v, 0], seamless.x[v, 1] = chart, x, y
    change = turn, sx, sy
    if turn % 2 == 1 and seamless.freedom[v] != FREE:
        seamless.freedom[v] = COLUMN + ROW - seamless.freedom[v]
    back = inverse(change)
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        frame = after(back, frame_of(seamless, f, k))
        seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1] = frame


@kernel
def follow(
    seamless: SeamlessMap, chart: int, px: float, py: float, qx: float, qy: float
) -> tuple[int, int, int, int, float, float]:
    """Go straight from p, in a chart, to q, in its frame.

    Returns
    -------
    chart, turn, shift x, shift y, x, y
        The chart in which q lies, the change to its frame, and q there.
    """
    glued = seamless.glued
    turn, sx, sy, came = 0, 0, 0, -1
    for _ in range(_MOST_CHARTS):
        # the side through which the way leaves the square
        side, least = -1, 1.0
        if qy < 0.0 and came != 0 and py / (py - qy) < least:
            side, least = 0, py / (py - qy)
        if qx > 1.0 and came != 1 and (1.0 - px) / (qx - px) < least:
            side, least = 1, (1.0 - px) / (qx - px)
        if qy > 1.0 and came != 2 and (1.0 - py) / (qy - py) < least:
            side, least = 2, (1.0 - py) / (qy - py)
        if qx < 0.0 and came != 3 and px / (px - qx) < least:
            side, least = 3, px / (px - qx)
        if side < 0 or glued[chart, side, 0] < 0:
            break
        t, (ax, ay) = seamless.side_turn[chart, side], seamless.side_shift[chart, side]
        px, py = turned(px, py, t)
        qx, qy = turned(qx, qy, t)
        px, py, qx, qy = px + ax, py + ay, qx + ax, qy + ay
        x, y = turned(float(sx), float(sy), t)
        sx, sy, turn = int(x) + ax, int(y) + ay, (turn + t) % 4
        chart, came = glued[chart, side, 0], glued[chart, side, 1]
    return chart, turn, sx, sy, qx, qy
