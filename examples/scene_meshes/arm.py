"""Shipped skin of an arm over two bones: a tube with round ends.

`python examples/scene_meshes/arm.py` writes `scenes/meshes/arm.skn` again.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from ripple_sim.scenes.shapes import Array, Triangles

SKIN_FILE = Path(__file__).parents[2] / "scenes" / "meshes" / "arm.skn"

# from the shoulder down, and of the tube [m]
LENGTH = 0.7
ELBOW = 0.35
RADIUS = 0.07
_BEND = 0.06  # half the length over which the skin turns from one bone to the other [m]


def arm(circles: int = 48, sides: int = 24) -> tuple[Array, Triangles]:
    """Closed tube from the origin down, thinner towards its end; V [n, 3] [m] and F [m, 3]."""
    t = (1 - np.cos(np.linspace(0, np.pi, circles + 2)[1:-1])) / 2
    depth = -RADIUS + (LENGTH + 2 * RADIUS) * t
    end = np.minimum(depth + RADIUS, LENGTH + RADIUS - depth) / RADIUS
    width = (
        RADIUS * (1 - 0.25 * t) * np.sqrt(np.clip(end * (2 - end), 0, 1) * (end < 1) + (end >= 1))
    )
    angle = 2 * np.pi * np.arange(sides) / sides
    tube = np.stack(
        [
            np.outer(width, np.cos(angle)),
            np.outer(width, np.sin(angle)),
            -np.tile(depth[:, None], sides),
        ],
        axis=-1,
    )
    V = np.concatenate([tube.reshape(-1, 3), [[0, 0, RADIUS], [0, 0, -LENGTH - RADIUS]]])
    number = np.arange(circles * sides).reshape(circles, sides)
    after = np.roll(number, -1, axis=1)
    a = number[:-1].ravel()
    b = after[:-1].ravel()
    c = number[1:].ravel()
    d = after[1:].ravel()
    top = np.full(sides, len(V) - 2)
    bottom = np.full(sides, len(V) - 1)
    ends = [
        np.stack([top, number[0], after[0]], axis=1),
        np.stack([bottom, after[-1], number[-1]], axis=1),
    ]
    return V, np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1), *ends])


def write_skin(path: Path, V: Array, F: Triangles) -> None:
    """Write MuJoCo's skin format with the bones "upper" and "lower"; "lower" is at the elbow."""
    lower = np.clip((-V[:, 2] - ELBOW + _BEND) / (2 * _BEND), 0, 1)
    content = (
        struct.pack("<4i", len(V), 0, len(F), 2)
        + V.astype("<f4").tobytes()
        + F.astype("<i4").tobytes()
    )
    for name, weights, height in (("upper", 1 - lower, 0.0), ("lower", lower, -ELBOW)):
        which = np.flatnonzero(weights > 0)
        content += name.encode().ljust(40, b"\0") + struct.pack("<7f", 0, 0, height, 1, 0, 0, 0)
        content += (
            struct.pack("<i", len(which))
            + which.astype("<i4").tobytes()
            + weights[which].astype("<f4").tobytes()
        )
    path.write_bytes(content)


if __name__ == "__main__":
    write_skin(SKIN_FILE, *arm())
