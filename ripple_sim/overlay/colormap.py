"""A diverging colour map: blue for negative, almost white for zero, red for positive values.

It is a curve in CIELAB of constant speed, so that equal steps of the value look equally large. Both arms have the same
lightness at the same distance from zero, and blue differs from orange-red in every common colour vision.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.render.color import linear_to_srgb

SIZE = 513  # odd: zero has a colour of its own

# lightness, chroma at equal distances from zero; hues of the two arms [degrees]
_ARM = np.array([(96.0, 0.0), (85.0, 19.0), (70.0, 39.0), (53.0, 49.0), (34.0, 45.0)])
_BLUE, _RED = (245.0, 285.0), (62.0, 30.0)  # near zero, at the end

_WHITE = np.array([0.95047, 1.0, 1.08883])  # D65
_XYZ_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


@functools.lru_cache(maxsize=1)
def color_table() -> NDArray[np.uint8]:
    """Return the colours, sRGB uint8 [SIZE, 3], from the most negative to the most positive value."""
    negative, positive = (_evenly(_arm(*hues)) for hues in (_BLUE, _RED))
    lab = np.concatenate([negative[::-1], positive[1:]])
    table = np.rint(255 * np.clip(lab_to_srgb(lab), 0, 1)).astype(np.uint8)
    table.setflags(write=False)
    return table


def colors(values: ArrayLike, limit: float) -> NDArray[np.uint8]:
    """Colours of values, sRGB uint8 [..., 3]; the map extends from -limit to limit, and values beyond are clipped."""
    place = np.clip(np.asarray(values, dtype=np.float64) / limit, -1, 1)
    return color_table()[np.rint((0.5 + 0.5 * place) * (SIZE - 1)).astype(np.int64)]


def lab_to_srgb(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """SRGB values (IEC 61966-2-1) of CIELAB colours under D65, [..., 3]; outside of 0 to 1 where sRGB has none."""
    f = (lab[..., :1] + 16) / 116 + np.stack([lab[..., 1] / 500, np.zeros(lab.shape[:-1]), -lab[..., 2] / 200], axis=-1)
    xyz = _WHITE * np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    rgb = xyz @ _XYZ_TO_RGB.T
    return linear_to_srgb(rgb)


def _arm(hue_near: float, hue_end: float) -> NDArray[np.float64]:
    """CIELAB colours from zero to an end, [k, 3], through the control points."""
    place = np.linspace(0, 1, 1025)
    lightness, chroma = (_smooth(place, column) for column in _ARM.T)
    hue = np.radians(hue_near + (hue_end - hue_near) * place)
    return np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=1)


def _smooth(place: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polynomial through control points at equal distances."""
    knots = np.linspace(0, 1, len(points))
    return np.asarray(np.polyval(np.polyfit(knots, points, len(points) - 1), place), dtype=np.float64)


def _evenly(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of a curve at equal differences of colour (CIE 1976), [SIZE // 2 + 1, 3]."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lab, axis=0), axis=1))])
    even = np.linspace(0, length[-1], SIZE // 2 + 1)
    return np.stack([np.interp(even, length, column) for column in lab.T], axis=1)
