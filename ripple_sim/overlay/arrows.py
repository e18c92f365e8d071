"""Arrows with a light rim and smooth edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .marks import INK, PAPER, Sprite

HEAD_LENGTH, HEAD_WIDTH, DOT, RIM = 6.0, 2.2, 1.5, 0.7  # in thicknesses of the shaft


def draw_arrow(sprite: Sprite, tip: ArrayLike, tail: ArrayLike, thickness: float, opacity: ArrayLike = (1.0,)) -> None:
    """Draw an arrow with a dot at its tip.

    Parameters
    ----------
    sprite : Sprite
    tip, tail : [2]
        [pixels], x to the right, y down.
    thickness : float
        Of the shaft [pixels].
    opacity : [k]
        0 to 1, at equal distances from tip to tail.
    """
    tip, opacity = np.asarray(tip, dtype=np.float64), np.asarray(opacity, dtype=np.float64)
    way = np.asarray(tail, dtype=np.float64) - tip
    length = float(np.hypot(*way))
    along = way / max(length, 1e-9)
    x, y = np.arange(sprite.width) + 0.5 - tip[0], np.arange(sprite.height)[:, None] + 0.5 - tip[1]
    u, across = x * along[0] + y * along[1], np.abs(y * along[0] - x * along[1])
    outside = _distance(u, across, length, thickness)
    place = np.clip(u / max(length, 1e-9), 0, 1) * (len(opacity) - 1)
    here = np.interp(place, np.arange(len(opacity)), opacity)
    sprite.fill(np.clip(0.5 - (outside - RIM * thickness), 0, 1) * here, PAPER, 0.9)
    sprite.fill(np.clip(0.5 - outside, 0, 1) * here, INK)


def _distance(u: NDArray, across: NDArray, length: float, thickness: float) -> NDArray[np.float64]:
    """Distance [pixels] of places, `u` along the arrow from its tip and `across`, from the shape; negative inside."""
    dot = np.hypot(u, across) - DOT * thickness
    if length < DOT * thickness:
        return dot
    head = min(HEAD_LENGTH * thickness, length)
    half = HEAD_WIDTH / HEAD_LENGTH * head
    triangle = np.maximum((across * head - u * half) / np.hypot(head, half), u - head)
    shaft = np.maximum(across - thickness / 2, np.maximum(0.8 * head - u, u - length))
    return np.minimum(np.minimum(triangle, shaft), dot)
