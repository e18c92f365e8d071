"""Coefficients that nobody gave."""

from __future__ import annotations


class Unset(float):
    """A default value: it counts as the number that it is, until someone who knows better replaces it.

    `WaveSolver` takes it as it stands. `Ripples` knows the model, and puts in what suits its target.
    """

    __slots__ = ()
