"""Splitting of edges in their middle: long ones, and those that join two points of a border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .surface import Subdivision, Surface

_MOST_ROUNDS = 100
_MOST_TRIANGLES, _MOST_GROWTH = 40_000, 3  # of a part; of one that has more to begin with, so many times as many


def halved(surface: Surface, chosen: NDArray[np.bool_]) -> Subdivision:
    """Split chosen edges [e] in their middle."""
    return surface.subdivided(np.where(chosen, 0.5, np.nan))


def halved_chords(surface: Surface, part: NDArray[np.int64], on_border: NDArray[np.bool_]) -> Subdivision:
    """Split edges inside a part [m] of which both ends lie on its border: flattened, they could lie on one side."""
    sides = surface.edges.sides
    inner = (sides >= 0).all(axis=1) & (part[sides[:, 0] // 3] == part[sides[:, 1] // 3])
    return halved(surface, inner & on_border[surface.edges.ends].all(axis=1))


def refined(surface: Surface, longest: float) -> Surface:
    """Split edges until none is longer than `longest` [m], that of a triangle first, so that needles lose length.

    Where that would take too many triangles, longer ones are left.
    """
    most = max(_MOST_TRIANGLES, _MOST_GROWTH * len(surface.F))
    for _ in range(_MOST_ROUNDS):
        lengths = surface.edge_lengths
        own = np.take_along_axis(surface.edges.of, lengths[surface.edges.of].argmax(axis=1)[:, None], axis=1)
        chosen = np.zeros(len(lengths), bool)
        chosen[own] = True
        chosen &= lengths > longest
        if not chosen.any() or len(surface.F) > most:
            break
        surface = halved(surface, chosen).surface
    return surface
