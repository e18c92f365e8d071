"""Undoing collapses: each vertex comes back inside the kernel of its star, so that no triangle ever folds.

Next to the vertex v it was merged with, the kernel is the wedge between the great circles through v and the two
neighbours they share, left and right. The bisector of that wedge always leads into it.
"""

from __future__ import annotations

import numpy as np

from .corner_table import CornerTable, following, gather_star, preceding, undo_collapse
from .energy import Reference, star_energy
from .reference import Source, update_load, update_triangle
from .relaxation import relax_vertex
from .vectors import Floats, Ints, combine, cross, kernel, row, set_row, unit

CROWDED = 64  # neighbours of a new vertex with more triangles than this wait for the sweeps


@kernel
def _place(h: int, table: CornerTable, star: Ints, degree: int, S: Floats, reference: Reference) -> None:
    """Put the tail of h where its star's energy is least among trial points."""
    tail = table.tail
    u, v = tail[h], tail[table.twin[h]]
    left, right = tail[preceding(h)], tail[preceding(table.twin[h])]
    start = row(S, v)
    middle = (0.0, 0.0, 0.0)
    for i in range(degree):
        middle = combine(1.0, middle, 1.0, row(S, tail[following(star[i])]))
    inward = combine(1.0, unit(cross(start, row(S, left))), 1.0, unit(cross(row(S, right), start)))
    least = np.inf
    best = start
    for goal, share, trials in ((unit(middle), 0.65, 16), (unit(combine(1.0, start, 1.0, unit(inward))), 0.4, 40)):
        t = 1.0
        for _ in range(trials):
            p = unit(combine(1.0 - t, start, t, goal))
            energy = star_energy(p, star, degree, tail, S, reference)
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
def insert_vertices(log: Ints, table: CornerTable, source: Source, S: Floats, reference: Reference) -> None:
    """Undo the collapses in `log`, latest first, and relax round every new vertex.

    A vertex that finds no place leaves a fold behind, which the certificate will find.
    """
    tail = table.tail
    star, other = np.empty(len(S), np.int32), np.empty(len(S), np.int32)
    for h in log[::-1]:
        u, v = tail[h], tail[table.twin[h]]
        undo_collapse(table, h)
        source.carried[v] -= source.carried[u]
        for w in (v, u):
            update_load(w, star, gather_star(table, w, star), tail, source)
        for w in (v, u):
            degree = gather_star(table, w, star)
            for i in range(degree):
                update_triangle(star[i] // 3, tail, source, reference)
        _place(h, table, star, degree, S, reference)
        relax_vertex(u, star, degree, tail, S, reference)
        for i in range(degree):
            w = tail[following(star[i])]
            other_degree = gather_star(table, w, other)
            if other_degree <= CROWDED:
                relax_vertex(w, other, other_degree, tail, S, reference)
        relax_vertex(u, star, degree, tail, S, reference)
