"""Splitting of edges in their middle: long ones, and those that join two points of a border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .surface import AB, BC, CA, A, B, C, Subdivision, Surface, Triangle

# each set of halved sides (see `Surface.subdivided`), with the triangles that take the place of the whole
_HALVES: dict[int, tuple[Triangle, ...]] = {
    1: ((A, AB, C), (AB, B, C)),
    2: ((B, BC, A), (BC, C, A)),
    4: ((C, CA, B), (CA, A, B)),
    3: ((AB, B, BC), (A, AB, BC), (A, BC, C)),
    6: ((BC, C, CA), (B, BC, CA), (B, CA, A)),
    5: ((CA, A, AB), (C, CA, AB), (C, AB, B)),
    7: ((A, AB, CA), (AB, B, BC), (CA, BC, C), (AB, BC, CA)),
}
_MOST_ROUNDS = 40


def halved(surface: Surface, chosen: NDArray[np.bool_]) -> Subdivision:
    """Split chosen edges [e] in their middle."""
    return surface.subdivided(np.where(chosen, 0.5, np.nan), _HALVES)


def halved_chords(surface: Surface, part: NDArray[np.int64], on_border: NDArray[np.bool_]) -> Subdivision:
    """Split edges inside a part [m] of which both ends lie on its border: flattened, they could lie on one side."""
    sides = surface.edges.sides
    inner = (sides >= 0).all(axis=1) & (part[sides[:, 0] // 3] == part[sides[:, 1] // 3])
    return halved(surface, inner & on_border[surface.edges.ends].all(axis=1))


def refined(surface: Surface, longest: float) -> Surface:
    """Split edges until none is longer than `longest` [m]."""
    for _ in range(_MOST_ROUNDS):
        long = surface.edge_lengths > longest
        if not long.any():
            break
        surface = halved(surface, long).surface
    return surface
