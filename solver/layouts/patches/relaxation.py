"""Relaxation of a seamless map: all of its vertices at once, and each by itself inside its star.

Newton steps of all vertices at once are cut short by the first triangle that would fold; sweeps over single vertices
clear such spots.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints, Ints32, kernel
from ...mesh.topology import edges_of
from ..newton import CG_TOLERANCE, System, conjugate_gradients, descend_by_newton, line_search
from .energy import TERMS, ChartShapes, assemble, sweep, total_energy
from .seamless import SeamlessMap, Transitions, corner_place, rehome, turned

_LONGEST_STEP = 0.5  # of a chart
_SWEEPS = 2
_MOST_STEPS = 30
_CG_RANGE = 40, 200


def scratch(seamless: SeamlessMap) -> Floats:
    """Room for the star of any vertex, [d, 7]."""
    return np.empty((int(np.diff(seamless.star_start).max()), TERMS))


def sweep_all(seamless: SeamlessMap, shapes: ChartShapes, across: Transitions, backwards: bool) -> float:
    """Move every vertex once, and follow them into their charts; return by how much the energy fell."""
    before, vertices = seamless.x.copy(), np.arange(len(seamless.x))
    if backwards:
        vertices = vertices[::-1].copy()
    fall = sweep(seamless, shapes, across, vertices, scratch(seamless), False)
    rehome(seamless, across, before)
    return fall


def relax_all(seamless: SeamlessMap, shapes: ChartShapes, across: Transitions, least_gain: float) -> None:
    """Lower the energy of a map in place, until a step saves less than this share of it: sweeps, then Newton steps."""
    edges = edges_of(seamless.F)
    ends = edges.ends.astype(np.int32)
    for i in range(_SWEEPS):
        sweep_all(seamless, shapes, across, i % 2 == 0)
    descend_by_newton(
        lambda cg_steps: newton_step(seamless, shapes, across, edges.of, ends, cg_steps),
        lambda backwards: sweep_all(seamless, shapes, across, backwards),
        lambda: total_energy(seamless, shapes),
        (least_gain, 1, _MOST_STEPS),
        _CG_RANGE,
    )


def newton_step(
    seamless: SeamlessMap, shapes: ChartShapes, across: Transitions, edge: Ints, ends: Ints32, cg_steps: int
) -> tuple[float, float]:
    """Move the map by one Newton step in place; return by how much the energy fell, and the step's length.

    Whole steps have length 1; 0 where no step lowers the energy. `edge` [m, 3] are the edges ab, bc, ca of the
    triangles, and `ends` [e, 2] their vertices.
    """
    system = System.zeros(len(seamless.x), len(ends))
    energy = total_energy(seamless, shapes)
    assemble(seamless, shapes, edge, ends, system)
    _hold(seamless.freedom, ends, system)
    step = conjugate_gradients(ends, system, cg_steps, CG_TOLERANCE)
    slope = float((system.gradient * step).sum())
    if not slope < 0:
        return 0.0, 0.0
    before = seamless.x.copy()
    longest = float(np.sqrt((step * step).sum(axis=1).max()))
    bound = min(0.9 * _time_of_first_fold(seamless, step), _LONGEST_STEP / longest)

    def energy_at(t: float) -> float:
        seamless.x[:] = before + t * step
        return total_energy(seamless, shapes)

    t, lower = line_search(energy, slope, bound, energy_at)
    seamless.x[:] = before + t * step
    rehome(seamless, across, before)
    return energy - lower, t


def _hold(freedom: Ints, ends: Ints32, system: System) -> None:
    """Take out the directions in which vertices may not move."""
    free = np.stack([freedom & 1, freedom >> 1], axis=1).astype(bool)
    system.gradient[~free] = 0.0
    system.diagonal[~free[:, 0], 0] = system.diagonal[~free[:, 1], 2] = 1.0
    system.diagonal[~free.all(axis=1), 1] = 0.0
    held = np.flatnonzero(~free[ends].all(axis=(1, 2)))
    first, second = free[ends[held]].transpose(1, 0, 2)
    both = (first[:, :, None] & second[:, None, :]).reshape(-1, 4)
    system.blocks[held] = np.where(both, system.blocks[held], 0.0)


@kernel
def _time_of_first_fold(seamless: SeamlessMap, step: Floats) -> float:
    """The first time at which a triangle has no area, if its corners move by `step` in a unit of time."""
    first = np.inf
    x, d = np.empty((3, 2)), np.empty((3, 2))
    for f in range(len(seamless.F)):
        for k in range(3):
            v = seamless.F[f, k]
            x[k, 0], x[k, 1] = corner_place(seamless, f, k)
            d[k, 0], d[k, 1] = turned(step[v, 0], step[v, 1], seamless.turn[f, k])
        ux, uy, vx, vy = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], x[2, 0] - x[0, 0], x[2, 1] - x[0, 1]
        px, py, qx, qy = d[1, 0] - d[0, 0], d[1, 1] - d[0, 1], d[2, 0] - d[0, 0], d[2, 1] - d[0, 1]
        c = ux * vy - uy * vx
        b = ux * qy - uy * qx + px * vy - py * vx
        a = px * qy - py * qx
        # the least positive root of a t^2 + b t + c, with c > 0
        root = b * b - 4 * a * c
        if root < 0 or (a >= 0 and b >= 0):
            continue
        t = 2 * c / (-b + np.sqrt(root))
        if t > 0:
            first = min(first, t)
    return first
