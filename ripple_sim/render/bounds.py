"""Bounding balls: of visuals, of parts of a mesh, of all shadow casters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Balls(NamedTuple):
    """Centres [k, 3] and radii [k] in the world [m]; a radius may be infinite."""

    centres: NDArray[np.float64]
    radii: NDArray[np.float64]


def join(*balls: Balls) -> Balls:
    """All balls in one list."""
    return Balls(np.concatenate([each.centres for each in balls]), np.concatenate([each.radii for each in balls]))


def within(balls: Balls, point: NDArray[np.float64], reach: float) -> Balls:
    """Those balls that any point within `reach` [m] of a point [3] touches."""
    near = np.linalg.norm(balls.centres - point, axis=1) - balls.radii < reach
    return Balls(balls.centres[near], balls.radii[near])


def enclosing(balls: Balls) -> tuple[NDArray[np.float64], float]:
    """Centre [3] and radius of a ball that contains others."""
    centres, radii = balls
    centre = ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0)) / 2
    return centre, float((np.linalg.norm(centres - centre, axis=1) + radii).max())


def balls_about(triangles: NDArray[np.float64], count: int) -> Balls:
    """Balls that each contain a share of some triangles, which are close together.

    Parameters
    ----------
    triangles : array, shape [m, 3, 3]
        Corners [m].
    count : int
        The least number of balls, unless there are fewer triangles.
    """
    groups = [triangles]
    while len(groups) < min(count, len(triangles)):
        halves = []
        for group in groups:
            middles = group.mean(axis=1)
            order = np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")
            halves += [group[half] for half in np.array_split(order, 2) if len(half)]
        groups = halves
    corners = [group.reshape(-1, 3) for group in groups]
    centres = np.array([(each.min(axis=0) + each.max(axis=0)) / 2 for each in corners])
    radii = [np.linalg.norm(each - centre, axis=1).max() for each, centre in zip(corners, centres, strict=True)]
    return Balls(centres, np.array(radii))
