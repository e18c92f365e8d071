"""Large charts: two triangles between cells' middles are one, and so are the two charts round a corner at a rim.

Chart a of a cell and the next one b round a corner lie at the same side of a triangle between cells' middles, which is
called by a: from the middle of a's cell to that of b's. Beyond it lies another triangle, or two charts at a rim.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .charts import Fans, Sides, charts_of, fans_of, glued_sides
from .pairing import Joints, chosen_joints
from .polygons import Path
from .surface import Surface


def joined(
    surface: Surface, chart: NDArray[np.int64], sides: list[Sides]
) -> tuple[Surface, NDArray[np.int64], list[Sides]] | None:
    """Join the charts of cells [m] to larger ones; None where that is not possible."""
    glued = glued_sides(sides)
    fans, rest = fans_of(sides, glued)
    cell = np.unique([each[0][0] for each in sides], return_inverse=True)[1]
    at_rim = (glued[..., 0] < 0)[:, 1:3]
    if not at_rim[rest].any(axis=1).all():
        return None
    joints, first = _joints(surface.V, sides, glued, fans)
    wanted = 4 - _curvature(surface, cell[chart]) + np.bincount(cell, at_rim.all(axis=1))
    joints = joints._replace(middles=cell[joints.middles])
    chosen = chosen_joints(joints, len(fans), np.bincount(cell), wanted)
    if chosen is None:
        return None
    alone = joints.triangles[chosen, 1] < 0
    new = [_quad(sides, glued, a) for a in first[chosen[~alone]]]
    new += [_lone_triangle(sides, glued, a) for a in first[chosen[alone]]]
    new += _at_rim(sides, glued, rest, glued[first[chosen[alone]], 0, 0])
    if (glued_sides(new)[..., 0] == np.arange(len(new))[:, None]).any():
        return None
    surface, chart = charts_of(surface, new)
    return surface, chart, new


def _curvature(surface: Surface, cell: NDArray[np.int64]) -> NDArray[np.float64]:
    """Curvature of each cell, and of the rim in it, in right angles."""
    total = np.bincount(surface.F.ravel(), surface.angles.ravel(), len(surface.V))
    missing = np.where(surface.at_rim, np.pi, 2 * np.pi) - total
    share = (missing / total)[surface.F] * surface.angles
    return np.bincount(cell, share.sum(axis=1)) / (np.pi / 2)


def _joints(
    V: NDArray[np.float64], sides: list[Sides], glued: NDArray[np.int64], fans: Fans
) -> tuple[Joints, NDArray[np.int64]]:
    """Sides over which triangles may be joined, with charts for their cells, and what they are called."""
    fan = np.full(len(sides), -1)
    for number, each in enumerate(fans):
        fan[each] = number
    found = []
    for a in np.flatnonzero(fan >= 0).tolist():
        b, beyond = int(glued[a, 1, 0]), int(glued[a, 0, 0])
        # the other triangle calls it otherwise; two triangles with two sides in common would be glued to themselves
        if fan[beyond] < 0 or (a < glued[beyond, 2, 0] and (fan[glued[fans[fan[a]], 0, 0]] == fan[beyond]).sum() == 1):
            found.append((a, b, glued[b, 1, 0], glued[beyond, 1, 0], beyond))
    first, second, third, fourth, other = np.array(found, dtype=np.int64).reshape(-1, 5).T
    middle = V[[each[0][0] for each in sides]]
    inside, across = (np.linalg.norm(middle[p] - middle[q], axis=1) for p, q in ((first, second), (third, fourth)))
    shape = np.log(np.maximum(across, 1e-300) / np.maximum(inside, 1e-300))
    return Joints(np.stack([fan[first], fan[other]], axis=1), np.stack([first, second], axis=1), shape), first


def _whole(sides: list[Sides], glued: NDArray[np.int64], a: int) -> Path:
    """The side of a triangle, from middle to middle."""
    return np.concatenate([sides[a][0], sides[glued[a, 1, 0]][3][1:]])


def _quad(sides: list[Sides], glued: NDArray[np.int64], a: int) -> Sides:
    """Two triangles, joined over the side a."""
    b, beyond = glued[a, 1, 0], glued[a, 0, 0]
    around = (b, glued[b, 1, 0], beyond, glued[beyond, 1, 0])
    p, q, r, s = (_whole(sides, glued, each) for each in around)
    return p, q, r, s


def _lone_triangle(sides: list[Sides], glued: NDArray[np.int64], a: int) -> Sides:
    """A triangle with a fourth corner in the middle of its side a; the charts at the rim beyond stay apart."""
    b = glued[a, 1, 0]
    return sides[a][0], sides[b][3], _whole(sides, glued, b), _whole(sides, glued, glued[b, 1, 0])


def _at_rim(sides: list[Sides], glued: NDArray[np.int64], rest: list[int], apart: NDArray[np.int64]) -> list[Sides]:
    """Charts at the rim: those round a corner are joined, but for some that stay apart, called by the second one."""
    new = []
    for b in rest:
        a, before = int(glued[b, 2, 0]), int(glued[b, 1, 0])
        if a < 0 and before < 0:
            new.append(sides[b])
        elif a >= 0:
            # chart a has the rim before the corner, and b behind it
            if b in apart or a in apart:
                new += [sides[a], sides[b]]
            else:
                rim = np.concatenate([sides[b][1], sides[a][2][1:]])
                new.append((rim, sides[a][3], _whole(sides, glued, a), sides[b][0]))
    return new
