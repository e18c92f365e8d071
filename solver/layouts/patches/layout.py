"""From the triangles of a mesh to charts: components, cells, quads, relaxation.

Tips of cones move over the surface. They sit on vertices, where the cells' corners and middles
happened to be, and a tip in the wrong place strains the map round it until texels beside it fold.
So a tip may move on to a neighbouring vertex, if that lowers the energy: what was a cone's vertex
becomes a free one, and its neighbour is fixed on the tip. Frames change only in the two stars: a
turn round the old vertex is now nothing, a turn round the new one what the old one's was.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ...errors import AtlasError
from ...kernel import Floats, Ints, kernel
from ...mesh.topology import labels
from ..energy import FIXED, FREE, Density, Reference, star_energy
from .collapse import without_cuts
from .energy import Star, energy_of, gather, reference_of, relax_all, scratch, sweep, sweep_all
from .quads import CELLS, Quads, large_quads_of, quads_of
from .seamless import (
    Frame,
    SeamlessMap,
    after,
    follow,
    frame_of,
    inverse,
    seamless_map,
    turned,
    wedge,
)
from .surface import TriangleSurface

_LAYERS = 3  # of vertices that a tip's move may move
_SWEEPS = 3  # over the vertices round a tip, before it is judged
_WORTH = 1e-3  # share of the energy round a tip that a move must save

_MOST = 4 / 3  # times as many has a mesh in parts of uneven sizes
_FEWEST = 0.5  # cells that the smallest part should have by its area; in truth it has four
_NEGLIGIBLE = 2e-3  # share of the area of a part for which no others are cut smaller

# by so much more or less than its share of charts a part is cut again, so often
_MISJUDGED = 0.1
_TRIES = 3

# before the tips move and after: stop when a step saves less than this share of the energy
_ROUGH = 5e-3
_FINE = 2e-3
_MOST_MOVES = 5  # of a tip, by an edge each


def move_tips(seamless: SeamlessMap, reference: Reference, tips: Ints) -> Ints:
    """Move each tip to the first neighbour where the energy is lower.

    Returns where the tips that moved are.
    """
    return _move_tips(seamless, reference, tips, scratch(seamless))


@kernel
def _move_tips(seamless: SeamlessMap, reference: Reference, tips: Ints, star: Star) -> Ints:
    fan = np.empty((2, len(star.terms)), np.int64)
    mark = np.zeros(len(seamless.z) + len(seamless.F), np.int64)
    count = stamp = 0
    moved = np.empty(len(tips), np.int64)
    for v in tips:
        for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
            h = seamless.star[i]
            u = seamless.F[h // 3, (h % 3 + 1) % 3]
            corner = 3 * (h // 3) + (h % 3 + 1) % 3
            if seamless.freedom[u] != FREE or not (
                _fan(seamless, v, h, fan[0]) and _fan(seamless, u, corner, fan[1])
            ):
                continue
            stamp += 1
            vertices, triangles = _around(seamless, v, u, mark, stamp)
            if len(vertices) and _moved(seamless, reference, vertices, triangles, fan, star):
                moved[count] = u
                count += 1
                break
    return moved[:count]


@kernel
def _fan(seamless: SeamlessMap, v: int, h: int, fan: Ints) -> bool:
    """Corners of v, counter-clockwise from corner h; whether they go all round it."""
    first = seamless.star_start[v]
    last = seamless.star_start[v + 1]
    for i in range(last - first):
        fan[i] = h
        wanted = seamless.F[h // 3, (h % 3 + 2) % 3]
        h = -1
        for j in range(first, last):
            g = seamless.star[j]
            if seamless.F[g // 3, (g % 3 + 1) % 3] == wanted:
                h = g
        if h < 0:
            return False
    return h == fan[0]


@kernel
def _around(seamless: SeamlessMap, v: int, u: int, mark: Ints, stamp: int) -> tuple[Ints, Ints]:
    """A tip, the vertex that it may move to and those round both; all triangles at these.

    Nothing if there is another tip among their neighbours. `mark` [n + m] holds older stamps.
    """
    n = len(seamless.z)
    vertices = [v, u]
    triangles = [np.int64(0) for _ in range(0)]
    mark[v] = mark[u] = stamp
    first = 0
    last = 2
    for layer in range(_LAYERS):
        for at in range(first, last):
            for i in range(
                seamless.star_start[vertices[at]], seamless.star_start[vertices[at] + 1]
            ):
                h = seamless.star[i]
                w = seamless.F[h // 3, (h % 3 + 1) % 3]
                if layer == 0 and seamless.freedom[w] == FIXED and w != v:
                    return np.empty(0, np.int64), np.empty(0, np.int64)
                if mark[w] != stamp:
                    mark[w] = stamp
                    vertices.append(w)
        first = last
        last = len(vertices)
    for w in vertices:
        for i in range(seamless.star_start[w], seamless.star_start[w + 1]):
            f = seamless.star[i] // 3
            if mark[n + f] != stamp:
                mark[n + f] = stamp
                triangles.append(f)
    return np.array(vertices), np.array(triangles)


@kernel
def _moved(
    seamless: SeamlessMap,
    reference: Reference,
    vertices: Ints,
    triangles: Ints,
    fan: Ints,
    star: Star,
) -> bool:
    """Try to move a tip; whether it stays there."""
    before = energy_of(seamless, reference, triangles)
    z = seamless.z[vertices]
    chart = seamless.chart[vertices]
    freedom = seamless.freedom[vertices]
    turn = seamless.turn[triangles]
    shift = seamless.shift[triangles]
    v = vertices[0]
    u = vertices[1]
    _change_frames(seamless, v, u, fan)
    degree = gather(seamless, reference, v, 0j, star)
    _put_into_star(seamless, v, u, star, degree, reference.density)
    angle = 0.0
    for i in range(degree):
        p = complex(star.first[i, 0], star.first[i, 1]) - seamless.z[v]
        q = complex(star.second[i, 0], star.second[i, 1]) - seamless.z[v]
        angle += np.arctan2(wedge(p, q), p.real * q.real + p.imag * q.imag)
    _enter_chart(seamless, v)
    # round a wide cone's vertex the map may wind twice without a fold
    if angle < 3.0 * np.pi and energy_of(seamless, reference, triangles) < np.inf:
        for _ in range(_SWEEPS):
            sweep(seamless, reference, vertices, star, True)
        if energy_of(seamless, reference, triangles) < (1.0 - _WORTH) * before:
            return True
    seamless.z[vertices] = z
    seamless.chart[vertices] = chart
    seamless.freedom[vertices] = freedom
    seamless.turn[triangles] = turn
    seamless.shift[triangles] = shift
    return False


@kernel
def _put_into_star(
    seamless: SeamlessMap, u: int, v: int, star: Star, degree: int, density: Density
) -> None:
    """Put u, in the frame that it begins with, on a way from v, where its star's energy is least.

    No triangle of the star is folded there.
    """
    start = seamless.star_start[u]
    z = left = right = middle = 0j
    for i in range(degree):
        f = seamless.star[start + i] // 3
        k = seamless.star[start + i] % 3
        p = complex(star.first[i, 0], star.first[i, 1])
        q = complex(star.second[i, 0], star.second[i, 1])
        middle += (p + q) / (2 * degree)
        if seamless.F[f, (k + 1) % 3] == v:
            z = p
            left = q
        elif seamless.F[f, (k + 2) % 3] == v:
            z = q
            right = p
    # between the directions to left and right, as long as the shorter: the sum of both sides'
    # normals, inwards
    a = left - z
    b = right - z
    inward = 1j * (a / abs(a) - b / abs(b))
    inward = inward * (min(abs(a), abs(b)) / abs(inward)) if abs(inward) > 1e-9 else a
    least = np.inf
    best = z
    for way in range(2):
        goal, share, trials = (middle, 0.65, 16) if way == 0 else (z + inward, 0.4, 40)
        t = 0.65
        for _ in range(trials):
            p = z + t * (goal - z)
            energy = star_energy(star.terms, degree, density, (p.real, p.imag, 0.0))
            if energy < least:
                least = energy
                best = p
            elif least < np.inf:
                break
            t *= share
        if least < np.inf:
            break
    seamless.z[u] = best


@kernel
def _enter_chart(seamless: SeamlessMap, u: int) -> None:
    """Find the chart in which u lies, on a straight way from a neighbour, and take its frame."""
    first = seamless.star_start[u]
    last = seamless.star_start[u + 1]
    f = 0
    k = 0
    j = -1
    for i in range(first, last):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        for m in (1, 2):
            if j < 0 and seamless.freedom[seamless.F[f, (k + m) % 3]] != FIXED:
                j = m
        if j >= 0:
            break
    w = seamless.F[f, (k + j) % 3]
    change = after(frame_of(seamless, f, k), inverse(frame_of(seamless, f, (k + j) % 3)))
    goal = turned(seamless.z[u], change[0]) + change[1]
    seamless.chart[u], onward, seamless.z[u] = follow(
        seamless, seamless.chart[w], seamless.z[w], goal
    )
    back = inverse(after(change, onward))
    for i in range(first, last):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        seamless.turn[f, k], seamless.shift[f, k] = after(back, frame_of(seamless, f, k))


@kernel
def _change_frames(seamless: SeamlessMap, v: int, u: int, fan: Ints) -> None:
    """Free the tip's vertex v, and put u on the tip.

    `fan` [2, d] has the corners of v and of u, from the edge between them on.
    """
    degree = seamless.star_start[v + 1] - seamless.star_start[v]
    around = seamless.star_start[u + 1] - seamless.star_start[u]
    h = fan[0, 0]
    tip = seamless.shift[h // 3, h % 3]
    # v takes the frame of its first triangle, and carries it round without crossing the edge to u
    frame = 0, 0j
    for i in range(degree):
        h = fan[0, i]
        f = h // 3
        k = h % 3
        seamless.turn[f, k], seamless.shift[f, k] = frame
        g = fan[0, (i + 1) % degree]
        frame = after(frame, _change(seamless, f, (k + 2) % 3, g // 3, (g % 3 + 1) % 3))
    # the triangles of u see the tip, clockwise from the first, which was v's too
    for i in range(around):
        h = fan[1, (around - i) % around]
        f = h // 3
        k = h % 3
        if i > 0:
            before = fan[1, (around - i + 1) % around]
            turn, shift = _change(seamless, before // 3, (before % 3 + 1) % 3, f, (k + 2) % 3)
            tip = turned(tip, turn) + shift
        seamless.turn[f, k] = 0
        seamless.shift[f, k] = tip
    seamless.z[u] = 0.0
    seamless.freedom[u] = FIXED
    seamless.freedom[v] = FREE


@kernel
def _change(seamless: SeamlessMap, f: int, k: int, g: int, m: int) -> Frame:
    """Change from the frame of triangle f to the frame of triangle g.

    They share a free vertex: corner k of f, and corner m of g.
    """
    return after(inverse(frame_of(seamless, f, k)), frame_of(seamless, g, m))


@dataclasses.dataclass(frozen=True, eq=False)
class PatchMap:
    """A surface laid out on charts."""

    surface: TriangleSurface
    seamless: SeamlessMap


def patch_map(V: Floats, F: Ints, cells: int = CELLS) -> PatchMap:
    """Lay a manifold, oriented mesh out on the charts of about `cells` cells, without a fold.

    A cell has four to six charts.

    Where the largest part allows it charts are large, one for each of some more cells. Raises
    `AtlasError` if its triangles are too thin, or no cells are found.
    """
    parts, counts, shares = _components(V, F, cells)
    widest = int(shares.argmax())
    first = large_quads_of(parts[widest], counts[widest])
    large = first is not None
    quads = [
        first if first and i == widest else quads_of(part, counts[i], large)
        for i, part in enumerate(parts)
    ]
    wanted = shares * sum(len(each.glued) for each in quads)
    # cells are mended until they are disks with corners enough, which changes their number: a part
    # that has come to more or less than the charts that its area should have is cut again, and the
    # best of the tries kept
    for i in np.flatnonzero(shares > _NEGLIGIBLE) if len(parts) > 1 else ():
        latest = quads[i]
        count = counts[i]
        for _ in range(_TRIES):
            charts = len(latest.glued)
            count, before = max(1, round(count * float(np.sqrt(wanted[i] / charts)))), count
            if abs(charts / wanted[i] - 1) < _MISJUDGED or count == before:
                break
            try:
                latest = quads_of(parts[i], count, large)
            except AtlasError:  # what there was before is good
                break
            quads[i] = min(
                quads[i], latest, key=lambda each: abs(np.log(len(each.glued) / wanted[i]))
            )
    whole = _joined(quads)
    surface, seamless = without_cuts(whole.surface, seamless_map(whole), whole.cut)
    relax(surface.V, seamless)
    return PatchMap(surface, seamless)


def relax(V: Floats, seamless: SeamlessMap) -> None:
    """Even out areas and take away shear, in place, as far as the map's cones allow.

    V [n, 3] are the vertices of the map [m].

    Cells are small and flat enough for that from where the quads lie; no step folds a triangle.
    """
    reference = reference_of(V, seamless.F, len(seamless.glued))
    relax_all(seamless, reference, _ROUGH)
    tips = np.flatnonzero(seamless.freedom == FIXED)
    for i in range(_MOST_MOVES):
        tips = move_tips(seamless, reference, tips)
        if not len(tips):
            break
        sweep_all(seamless, reference, i % 2 == 0)
    relax_all(seamless, reference, _FINE)


def _components(V: Floats, F: Ints, cells: int) -> tuple[list[TriangleSurface], list[int], Floats]:
    """Each connected component, how many cells it gets, and its share of the area."""
    part = labels(np.stack([F, np.roll(F, -1, axis=1)], axis=-1).reshape(-1, 2), len(V))
    number, of = np.unique(part[F[:, 0]], return_inverse=True)
    areas = TriangleSurface.of(V, F).areas
    share = np.bincount(of, areas / areas.sum()).astype(np.float64)
    # a small part has a few cells at least; where others have more, its texels are less tiny beside
    # theirs
    small = share[share >= min(_NEGLIGIBLE, share.max())].min()
    count = np.maximum(1, np.rint(np.clip(_FEWEST / small, cells, _MOST * cells) * share)).astype(
        int
    )
    parts = []
    for each in range(len(number)):
        faces = np.flatnonzero(of == each)
        used, corners = np.unique(F[faces], return_inverse=True)
        parts.append(dataclasses.replace(TriangleSurface.of(V[used], corners), parent=faces))
    return parts, count.tolist(), share


def _joined(parts: list[Quads]) -> Quads:
    """Several surfaces as one."""
    if len(parts) == 1:
        return parts[0]
    vertices = np.cumsum([0, *(len(each.surface.V) for each in parts)])
    charts = np.cumsum([0, *(len(each.glued) for each in parts)])
    surface = TriangleSurface(
        np.concatenate([each.surface.V for each in parts]),
        np.concatenate(
            [each.surface.F + first for each, first in zip(parts, vertices, strict=False)]
        ),
        np.concatenate([each.surface.parent for each in parts]),
        np.concatenate([each.surface.inside for each in parts]),
    )
    glued = np.concatenate([each.glued for each in parts])
    first_of_part = np.repeat(charts[:-1], np.diff(charts))
    glued[..., 0] += np.where(glued[..., 0] >= 0, first_of_part[:, None], 0)
    return Quads(
        surface,
        np.concatenate([each.chart + first for each, first in zip(parts, charts, strict=False)]),
        np.concatenate([each.places for each in parts]),
        glued,
        np.concatenate([each.cut for each in parts]),
    )
