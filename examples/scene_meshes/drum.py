"""Shipped meshes of a drum: a flat skin, and the wall that it is stretched over.

`python examples/scene_meshes/drum.py` writes `scenes/meshes/drum_skin.obj` and
`scenes/meshes/drum_shell.obj` again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

from ripple_sim.scenes.shapes import Array, Triangles, write_obj

SKIN_FILE = Path(__file__).parents[2] / "scenes" / "meshes" / "drum_skin.obj"
WALL_FILE = SKIN_FILE.with_name("drum_shell.obj")

# of the skin's rim, and where it lies [m]
RADIUS = 0.4
HEIGHT = 0.32
_HOOP = 0.016  # radius of the rod round the rim [m]


def skin(circles: int = 24) -> tuple[Array, Triangles]:
    """Flat disk of even triangles at the drum's height, facing up: an open mesh.

    Returns
    -------
    V, F
        Vertices [n, 3] float64 [m] and triangles [m, 3] int64.
    """
    points = [np.zeros((1, 2))]
    for circle in range(1, circles + 1):
        angle = 2 * np.pi * np.arange(6 * circle) / (6 * circle)
        points.append(RADIUS * circle / circles * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    plane = np.concatenate(points)
    F = Delaunay(plane).simplices.astype(np.int64)
    a = plane[F[:, 1]] - plane[F[:, 0]]
    b = plane[F[:, 2]] - plane[F[:, 0]]
    clockwise = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    F[clockwise] = F[clockwise, ::-1]
    return np.column_stack([plane, np.full(len(plane), HEIGHT)]), F


def wall(segments: int = 72) -> tuple[Array, Triangles]:
    """Bulging tube with a hoop round its upper end: closed, of genus 1; V and F as of `skin`."""
    angle = np.linspace(0, 2 * np.pi, 17)[:-1]
    hoop = np.stack([RADIUS + _HOOP * np.cos(angle), HEIGHT + _HOOP * np.sin(angle)], axis=1)
    t = np.linspace(1, 0, 13)[1:]
    bulge = np.stack([RADIUS + 0.05 * np.sin(np.pi * t), (HEIGHT - _HOOP) * t], axis=1)
    # counter-clockwise as seen with the axis on the left: over the hoop, down inside and up outside
    profile = np.concatenate([hoop[:9], bulge - [0.012, 0.0], bulge[::-1], hoop[13:]])
    turn = 2 * np.pi * np.arange(segments) / segments
    radius, height = profile.T
    V = np.stack(
        [
            np.outer(np.cos(turn), radius),
            np.outer(np.sin(turn), radius),
            np.tile(height, (segments, 1)),
        ],
        axis=-1,
    )
    number = np.arange(segments * len(profile)).reshape(segments, len(profile))
    after = np.roll(number, -1, axis=0)
    above = np.roll(number, -1, axis=1)
    both = np.roll(after, -1, axis=1)
    F = np.stack(
        [np.stack([number, after, both], axis=-1), np.stack([number, both, above], axis=-1)]
    )
    return V.reshape(-1, 3), F.reshape(-1, 3)


if __name__ == "__main__":
    write_obj(SKIN_FILE, *skin())
    write_obj(WALL_FILE, *wall())
