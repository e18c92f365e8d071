"""Colours that a program chooses for targets."""

from __future__ import annotations

import mujoco
import numpy as np

from ripple_sim.coupling.geoms import ByGeom, by_name
from ripple_sim.errors import SceneError

_COLOR_ENDS = (0.0, 1.0)  # sRGB


def colors_by_name(
    model: mujoco.MjModel, colors: ByGeom[tuple[float, float, float]] | None
) -> dict[str, tuple[float, float, float]]:
    """Colours, sRGB, by the names of their targets.

    Raises `SceneError` if a geom is missing or named twice, or a colour is invalid.
    """
    named = by_name(model, colors or {}, "colors")
    for name, color in named.items():
        numbers = np.asarray(color)
        low, high = _COLOR_ENDS
        is_color = numbers.shape == (3,) and np.issubdtype(numbers.dtype, np.number)
        if not (is_color and ((low <= numbers) & (numbers <= high)).all()):
            raise SceneError(
                f"the colour of {name!r} must be three numbers from 0 to 1, got {color!r}"
            )
    return {name: (float(r), float(g), float(b)) for name, (r, g, b) in named.items()}
