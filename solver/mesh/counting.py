"""Numbers and places in messages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_PLURALS = {"vertex": "vertices"}


def counted(number: int, thing: str) -> str:
    """A number and its noun: 1 edge, 2 edges, 1,000 vertices."""
    *words, noun = thing.split()
    return " ".join([f"{number:,}", *words, noun if number == 1 else _PLURALS.get(noun, noun + "s")])


def place(point: NDArray[np.float64]) -> str:
    """A point in brackets, to four digits."""
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
