"""Poses of geoms, and points taken into their frames and back into the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, kernel


class Pose(NamedTuple):
    """Of a geom in the world: position float64 [3] [m], and rotation float64 [3, 3] from its frame to the world."""

    position: Floats
    rotation: Floats


@kernel
def in_frame(points: Floats, pose: Pose) -> Floats:
    """Points in the world [m], [k, 3], taken into the frame of a geom."""
    local = np.zeros((len(points), 3))
    for i in range(len(points)):
        for k in range(3):
            for j in range(3):
                local[i, k] += (points[i, j] - pose.position[j]) * pose.rotation[j, k]
    return local


@kernel
def in_world(points: Floats, pose: Pose) -> Floats:
    """Points in the frame of a geom [m], [k, 3], taken into the world."""
    world = np.empty((len(points), 3))
    for i in range(len(points)):
        for k in range(3):
            across = 0.0
            for j in range(3):
                across += pose.rotation[k, j] * points[i, j]
            world[i, k] = pose.position[k] + across
    return world
