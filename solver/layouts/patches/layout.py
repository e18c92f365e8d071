"""From the triangles of a mesh to charts: components, cells, quads, relaxation.

Tips of cones move over the surface. They sit on vertices, where the cells' corners and middles
happened to be, and a tip in the wrong place strains the map round it until texels beside it fold.
So a tip may move on to a neighbouring vertex, if that lowers the energy: what was a cone's vertex
becomes a free one, and its neighbour is fixed on the tip. Frames change only in the two stars: a
turn round the old vertex is now nothing, a turn round the new one what the old one's was.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from ...errors import AtlasError
from ...kernel import Floats, Ints, kernel
from ...mesh.clean import counted, place
from ...mesh.topology import triangle_areas
from ..energy import FIXED, FREE, Density, Reference, star_energy
from .collapse import without_cuts
from .energy import (
    Star,
    energy_of,
    fill_star,
    reference_of,
    relax_all,
    star_buffers,
    sweep,
    sweep_all,
)
from .parts import (
    MAX_PARTS,
    MAX_STILL_SHARE,
    MIN_SIDE,
    MIN_TEXELS,
    Part,
    Parts,
    models_of,
    parts_of,
    transferred,
)
from .quads import CELLS, Quads, large_quads_of, quads_of
from .seamless import (
    Frame,
    SeamlessMap,
    after,
    follow,
    frame_of,
    inverse,
    seamless_map,
    stars,
    turned,
    wedge,
)
from .surface import TriangleSurface

# Layers of vertices round a tip that move along with it.
_LAYERS_ROUND_TIP = 3

# Sweeps over the vertices round a moved tip before the move is judged.
_SWEEPS_ROUND_TIP = 3

# Share of the energy round a tip that a move must save.
_MIN_SAVING = 1e-3

# A mesh in parts of uneven sizes may have so many times as many cells as other meshes.
_MAX_CELL_FACTOR = 4 / 3

# Cells that the smallest part should have by its share of the area. In truth a part has four at
# least.
_MIN_CELLS_OF_PART = 0.5

# Share of the area of a part for which the other parts are not cut into smaller cells.
_NEGLIGIBLE_AREA = 2e-3

# A part is cut again if its number of charts is off its share by this share of it.
_MAX_CHART_ERROR = 0.1

# Charts over cells from which on handles and loose parts decide on the number of charts, and not
# the number of cells.
_MAX_CHARTS_PER_CELL = 4

# There a part is cut again only if its number of charts is off by this share of it: cutting takes
# long, and gives about as many charts.
_MAX_CHART_ERROR_OF_MANY = 0.5

# Texels on a part over the texels in its area, at most: they are half as wide as elsewhere.
_MAX_CROWDING = 4

# Times that a part is cut again, at most.
_MAX_RECUTS = 2

# Relaxation before the tips move ends when a step saves less than this share of the energy.
_SAVING_BEFORE_TIPS = 5e-3

# Relaxation after the tips have moved ends when a step saves less than this share of the energy.
_SAVING_AFTER_TIPS = 2e-3

# Moves of a tip, by an edge each.
_MAX_TIP_MOVES = 5


def move_tips(seamless: SeamlessMap, reference: Reference, tips: Ints) -> Ints:
    """Move each tip to the first neighbour where the energy is lower.

    Returns where the tips that moved are.
    """
    return _move_tips(seamless, reference, tips, star_buffers(seamless))


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
    for layer in range(_LAYERS_ROUND_TIP):
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
    degree = fill_star(seamless, reference, v, 0j, star)
    _put_into_star(seamless, v, u, star, degree, reference.density)
    angle = 0.0
    for i in range(degree):
        p = complex(star.first[i, 0], star.first[i, 1]) - seamless.z[v]
        q = complex(star.second[i, 0], star.second[i, 1]) - seamless.z[v]
        angle += np.arctan2(wedge(p, q), p.real * q.real + p.imag * q.imag)
    _enter_chart(seamless, v)
    # round a wide cone's vertex the map may wind twice without a fold
    if angle < 3.0 * np.pi and energy_of(seamless, reference, triangles) < np.inf:
        for _ in range(_SWEEPS_ROUND_TIP):
            sweep(seamless, reference, vertices, star, True)
        if energy_of(seamless, reference, triangles) < (1.0 - _MIN_SAVING) * before:
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


# What says how far the work is: it is called with a line of text.
Report: TypeAlias = Callable[[str], None]


def tell_nobody(text: str) -> None:
    """Ignore how far the work is."""


@dataclasses.dataclass(frozen=True, eq=False)
class PatchMap:
    """A surface laid out on charts.

    Attributes
    ----------
    surface : TriangleSurface
    seamless : SeamlessMap
    still : int64 [k]
        Triangles of the mesh without charts, in ascending order: they lie still.
    notes : tuple of str
        Why they do, one line each.
    """

    surface: TriangleSurface
    seamless: SeamlessMap
    still: Ints
    notes: tuple[str, ...] = ()


def patch_map(
    V: Floats,
    F: Ints,
    cells: int = CELLS,
    texels: int | None = None,
    report: Report = tell_nobody,
) -> PatchMap:
    """Lay a manifold, oriented mesh out on the charts of about `cells` cells, without a fold.

    A cell has four to six charts. Where the largest part allows it charts are large, one for each
    of some more cells. Parts smaller than one of `texels` lie still, and so do parts that cannot be
    laid out.

    Raises `AtlasError` if no part can be laid out: its triangles are too thin, or no cells are
    found.
    """
    parts = parts_of(V, F, texels)
    counts = _cell_counts(np.array([part.share for part in parts.waving]), cells)
    models = models_of(parts.waving, counts)
    quads, failures = _quads_of_parts(parts.waving, counts, models, texels, report)
    notes = _still_notes(V, F, parts, texels)
    notes += _failure_notes(V, F, parts.waving, failures)
    still = [*parts.crumbs, *parts.surplus, *(parts.waving[i].faces for i in failures)]
    chart_count = sum(len(quads[models[i]].glued) for i in range(len(models)) if i not in failures)
    area = sum(part.share for i, part in enumerate(parts.waving) if i not in failures)
    relaxed: dict[int, tuple[TriangleSurface, SeamlessMap]] = {}
    maps = []
    for i, part in enumerate(parts.waving):
        if i in failures:
            continue
        model = models[i]
        if model not in relaxed:
            report(f"evening out part {i + 1} of {len(models)}")
            charts = chart_count * parts.waving[model].share / area
            relaxed[model] = _relaxed(quads[model], charts)
        surface, seamless = relaxed[model]
        if i != model:
            surface = transferred(surface, parts.waving[model], part)
        maps.append((surface, seamless))
    surface, seamless = _joined(maps)
    triangles = np.sort(np.concatenate(still)) if still else np.empty(0, np.int64)
    return PatchMap(surface, seamless, triangles, tuple(notes))


def _quads_of_parts(
    parts: list[Part],
    counts: list[int],
    models: list[int],
    texels: int | None,
    report: Report,
) -> tuple[dict[int, Quads], dict[int, AtlasError]]:
    """The quads of each model, and why parts have none.

    Raises the error of the largest part if no part has any.
    """
    shares = np.array([part.share for part in parts])
    largest = models[int(shares.argmax())]
    large_quads = large_quads_of(parts[largest].surface, counts[largest])
    large = large_quads is not None
    quads = {}
    errors: dict[int, AtlasError] = {}
    for i in sorted(set(models)):
        report(f"cutting part {i + 1} of {len(parts)}")
        try:
            if large_quads is not None and i == largest:
                quads[i] = large_quads
            else:
                quads[i] = quads_of(parts[i].surface, counts[i], large)
        except AtlasError as error:
            errors[i] = error
    if not quads:
        raise errors[largest]
    failures = {i: errors[model] for i, model in enumerate(models) if model in errors}
    charts = np.array([len(quads[model].glued) if model in quads else 0 for model in models])
    if texels is not None:
        failures |= _crowded(charts, shares, texels)
    waving = [i for i in range(len(parts)) if i not in failures]
    chart_count = int(charts[waving].sum())
    wanted = shares / shares[waving].sum() * chart_count
    are_many = chart_count > _MAX_CHARTS_PER_CELL * sum(counts)
    tolerance = _MAX_CHART_ERROR_OF_MANY if are_many else _MAX_CHART_ERROR
    if len(waving) > 1:
        for i in sorted(quads.keys() - failures.keys()):
            if shares[i] > _NEGLIGIBLE_AREA:
                report(f"cutting part {i + 1} of {len(parts)} again")
                quads[i] = _recut(
                    parts[i].surface, counts[i], large, quads[i], float(wanted[i]), tolerance
                )
    return quads, failures


def _crowded(charts: Ints, shares: Floats, texels: int) -> dict[int, AtlasError]:
    """Why parts with a number of charts and a share of the area lie still: texels would be tiny.

    They are the most crowded ones. Crumbs and they have little of the area together.
    """
    crowding = charts * MIN_SIDE**2 / (shares * texels)
    # the largest part that has charts carries waves in any case
    crowding[np.where(charts > 0, shares, 0.0).argmax()] = 0.0
    order = np.argsort(-crowding, kind="stable")
    crumbs_share = 1 - shares.sum()
    order = order[crumbs_share + np.cumsum(shares[order]) <= MAX_STILL_SHARE]
    error = AtlasError("texels would be less than half as wide as elsewhere")
    return dict.fromkeys(order[crowding[order] > _MAX_CROWDING].tolist(), error)


def _still_notes(V: Floats, F: Ints, parts: Parts, texels: int | None) -> list[str]:
    """Notes on the parts that lie still since they are too small or too many."""
    total = len(parts.waving) + len(parts.crumbs) + len(parts.surplus)
    notes = []
    if parts.crumbs:
        width = np.sqrt(triangle_areas(V, F).sum() / (texels or 1))  # [m]
        notes.append(
            f"{len(parts.crumbs):,} of {counted(total, 'part')} lie still: each smaller than "
            f"{MIN_TEXELS} texels of {width:.3g} m"
        )
    if parts.surplus:
        notes.append(
            f"{len(parts.surplus):,} of {counted(total, 'part')} lie still: at most the "
            f"{MAX_PARTS:,} largest carry waves"
        )
    return notes


def _failure_notes(
    V: Floats, F: Ints, parts: list[Part], failures: dict[int, AtlasError]
) -> list[str]:
    """Notes on the parts that lie still since they cannot be laid out, one for each reason."""
    parts_by_reason: dict[str, list[Part]] = {}
    for i, error in failures.items():
        parts_by_reason.setdefault(str(error), []).append(parts[i])
    notes = []
    for reason, alike in parts_by_reason.items():
        faces = alike[0].faces
        near = place(V[F[faces]].reshape(-1, 3).mean(axis=0))
        which = f"a part of {counted(len(faces), 'triangle')} near {near} lies still"
        if len(alike) > 1:
            do = "does" if len(alike) == 2 else "do"
            which = f"{which}, and so {do} {len(alike) - 1:,} more"
        notes.append(f"{which}: {reason}")
    return notes


def _relaxed(quads: Quads, charts: float) -> tuple[TriangleSurface, SeamlessMap]:
    """A part's map after relaxation; its area is that of a number of charts."""
    surface, seamless = without_cuts(quads.surface, seamless_map(quads), quads.cut)
    relax(surface.V, seamless, charts)
    return surface, seamless


def _recut(
    part: TriangleSurface,
    count: int,
    large: bool,
    quads: Quads,
    wanted_charts: float,
    tolerance: float,
) -> Quads:
    """Cut a part again with other numbers of cells, until it has about the wanted number of charts.

    Cells are mended until they are disks with corners enough, which changes their number. `quads`
    come from `count` cells. A number off by the share `tolerance` will do. The best of all tries is
    returned.
    """

    def error(candidate: Quads) -> float:
        return float(abs(np.log(len(candidate.glued) / wanted_charts)))

    best = quads
    latest = quads
    for _ in range(_MAX_RECUTS):
        charts = len(latest.glued)
        previous_count = count
        count = max(1, round(count * wanted_charts / charts))
        if abs(charts / wanted_charts - 1) < tolerance or count == previous_count:
            break
        try:
            latest = quads_of(part, count, large)
        except AtlasError:  # the best quads so far will do
            break
        best = min(best, latest, key=error)
    return best


def relax(V: Floats, seamless: SeamlessMap, charts: float | None = None) -> None:
    """Even out areas and take away shear, in place, as far as the map's cones allow.

    V [n, 3] are the vertices of the map [m]. Their surface has the area of a number of charts, by
    default of as many as there are. The map that the quads begin with is good enough for
    this, as cells are small and flat. No step folds a triangle.
    """
    reference = reference_of(V, seamless.F, len(seamless.glued) if charts is None else charts)
    relax_all(seamless, reference, _SAVING_BEFORE_TIPS)
    tips = np.flatnonzero(seamless.freedom == FIXED)
    for i in range(_MAX_TIP_MOVES):
        tips = move_tips(seamless, reference, tips)
        if not len(tips):
            break
        sweep_all(seamless, reference, i % 2 == 0)
    relax_all(seamless, reference, _SAVING_AFTER_TIPS)


def _cell_counts(shares: Floats, cells: int) -> list[int]:
    """How many cells parts get that have shares of the area."""
    # a small part has a few cells at least: if large parts have more cells, the texels of the small
    # part are less tiny beside theirs
    smallest = shares[shares >= min(_NEGLIGIBLE_AREA, shares.max())].min()
    total = np.clip(_MIN_CELLS_OF_PART / smallest, cells, _MAX_CELL_FACTOR * cells)
    return np.maximum(1, np.rint(total * shares)).astype(int).tolist()


def _joined(maps: list[tuple[TriangleSurface, SeamlessMap]]) -> tuple[TriangleSurface, SeamlessMap]:
    """Several surfaces and their maps as one."""
    if len(maps) == 1:
        return maps[0]
    triangles = []
    frames = []
    charts = []
    glued = []
    first_vertex = 0
    first_chart = 0
    for surface, seamless in maps:
        triangles.append(seamless.F + first_vertex)
        frames.append(seamless.frame + first_chart)
        charts.append(seamless.chart + first_chart)
        part_glued = seamless.glued.copy()
        part_glued[..., 0] += np.where(part_glued[..., 0] >= 0, first_chart, 0)
        glued.append(part_glued)
        first_vertex += len(surface.V)
        first_chart += len(seamless.glued)
    F = np.concatenate(triangles)
    start, star = stars(F, first_vertex)
    whole = SeamlessMap(
        F=F,
        frame=np.concatenate(frames),
        chart=np.concatenate(charts),
        z=np.concatenate([seamless.z for _, seamless in maps]),
        freedom=np.concatenate([seamless.freedom for _, seamless in maps]),
        turn=np.concatenate([seamless.turn for _, seamless in maps]),
        shift=np.concatenate([seamless.shift for _, seamless in maps]),
        glued=np.concatenate(glued),
        side_turn=np.concatenate([seamless.side_turn for _, seamless in maps]),
        side_shift=np.concatenate([seamless.side_shift for _, seamless in maps]),
        star_start=start,
        star=star,
    )
    joined_surface = TriangleSurface(
        np.concatenate([surface.V for surface, _ in maps]),
        F,
        np.concatenate([surface.parent for surface, _ in maps]),
        np.concatenate([surface.inside for surface, _ in maps]),
    )
    return joined_surface, whole
