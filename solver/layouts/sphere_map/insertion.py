"""Undoing collapses: each vertex comes back inside the kernel of its star, so that no triangle ever folds.

Next to the vertex v it was merged with, the kernel is the wedge between the great circles through v and the two
neighbours they share, left and right. The bisector of that wedge always leads into it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints32, kernel
from .corner_table import CornerTable, following, gather_star, preceding, undo_collapse
from .energy import Reference
from .level import set_shape
from .reference import Source, update_load, update_triangle
from .relaxation import relax_vertex
from .star import TERMS, energy_after, expand
from .vectors import combine, cross, dot, row, set_row, subtract, tangent_frame, unit

CROWDED = 64  # neighbours of a new vertex with more triangles than this wait for the sweeps


class _Star(NamedTuple):
    """Scratch for the star of one vertex, of room for so many neighbours; see `star.expand`."""

    ring: Floats  # [room, 3]
    shapes: Floats  # [room, 4]
    terms: Floats  # [room, 9]


@kernel
def _gather(neighbours: Ints32, degree: int, tail: Ints32, S: Floats, reference: Reference, star: _Star) -> None:
    """Fill in what `star.expand` asks for, from the half-edges to the neighbours."""
    for i in range(degree):
        set_row(star.ring, i, row(S, tail[following(neighbours[i])]))
        set_shape(star.shapes, i, neighbours[i], reference)


@kernel
def _place(u: int, v: int, left: int, right: int, S: Floats, star: _Star, degree: int) -> None:
    """Put u where its star's energy is least among trial points on the ways from v."""
    ring, shapes, terms = star
    start = row(S, v)
    x, y = tangent_frame(start)
    expand(start, x, y, ring, shapes, degree, terms)
    middle = (0.0, 0.0, 0.0)
    for i in range(degree):
        middle = combine(1.0, middle, 1.0, row(ring, i))
    inward = combine(1.0, unit(cross(start, row(S, left))), 1.0, unit(cross(row(S, right), start)))
    least = np.inf
    best = start
    for goal, share, trials in ((unit(middle), 0.65, 16), (unit(combine(1.0, start, 1.0, unit(inward))), 0.4, 40)):
        t = 1.0
        for _ in range(trials):
            p = unit(combine(1.0 - t, start, t, goal))
            move = subtract(p, start)
            energy = energy_after((dot(move, x), dot(move, y), dot(move, start)), terms, degree)
            if energy < least:
                least = energy
                best = p
            elif least < np.inf:
                break
            t *= share
        if least < np.inf:
            break
    set_row(S, u, best)


@kernel
def insert_vertices(log: Ints32, table: CornerTable, source: Source, S: Floats, reference: Reference) -> None:
    """Undo the collapses in `log`, latest first, and relax round every new vertex.

    A vertex that finds no place leaves a fold behind, which the certificate will find.
    """
    tail = table.tail
    neighbours, others = np.empty(len(S), np.int32), np.empty(len(S), np.int32)
    star = _Star(np.empty((len(S), 3)), np.empty((len(S), 4)), np.empty((len(S), TERMS)))
    other_star = _Star(np.empty((CROWDED, 3)), np.empty((CROWDED, 4)), star.terms)
    for h in log[::-1]:
        u, v = tail[h], tail[table.twin[h]]
        undo_collapse(table, h)
        source.carried[v] -= source.carried[u]
        for w in (v, u):
            update_load(w, neighbours, gather_star(table, w, neighbours), tail, source)
        for w in (v, u):
            degree = gather_star(table, w, neighbours)
            for i in range(degree):
                update_triangle(neighbours[i] // 3, tail, source, reference)
        _gather(neighbours, degree, tail, S, reference, star)
        _place(u, v, tail[preceding(h)], tail[preceding(table.twin[h])], S, star, degree)
        relax_vertex(u, S, star.ring, star.shapes, degree, star.terms)
        for i in range(degree):
            w = tail[following(neighbours[i])]
            other_degree = gather_star(table, w, others)
            if other_degree <= CROWDED:
                _gather(others, other_degree, tail, S, reference, other_star)
                relax_vertex(w, S, other_star.ring, other_star.shapes, other_degree, other_star.terms)
            set_row(star.ring, i, row(S, w))
