"""The colour map of heatmaps: blue for negative, almost white for zero, red for positive values.

It is a curve in CIELAB of constant speed, so that equal steps of the value look equally large. Both
arms have the same lightness at the same distance from zero, and blue differs from orange-red in
every common colour vision.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.render.tone_mapping import linear_to_srgb

SIZE = 513  # number of colours; odd: zero has a colour of its own

# CIELAB lightness and chroma of both arms, at equal distances from zero.
_ARM = np.array([(96.0, 0.0), (85.0, 19.0), (70.0, 39.0), (53.0, 49.0), (34.0, 45.0)])

# Hue of an arm near zero and at its end [degrees].
_BLUE = (245.0, 285.0)
_RED = (62.0, 30.0)

_WHITE = np.array([0.95047, 1.0, 1.08883])  # XYZ of D65

# From XYZ to linear sRGB (IEC 61966-2-1).
_XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


@functools.lru_cache(maxsize=1)
def color_table() -> NDArray[np.uint8]:
    """The colours, sRGB uint8 [SIZE, 3], from the most negative to the most positive value."""
    negative = _arm(*_BLUE)
    positive = _arm(*_RED)
    lab = np.concatenate([negative[::-1], positive[1:]])
    table = np.rint(255 * np.clip(lab_to_srgb(lab), 0, 1)).astype(np.uint8)
    table.setflags(write=False)
    return table


def colors(values: ArrayLike, limit: float) -> NDArray[np.uint8]:
    """Colours of values, sRGB uint8 [..., 3].

    The map extends from -limit to limit; values beyond are clipped.
    """
    place = np.clip(np.asarray(values, dtype=np.float64) / limit, -1, 1)
    index = np.rint((0.5 + 0.5 * place) * (SIZE - 1)).astype(np.int64)
    return color_table()[index]


def lab_to_srgb(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sRGB values (IEC 61966-2-1) of CIELAB colours [..., 3] under D65.

    They are outside of 0 to 1 where sRGB does not have the colour.
    """
    f = (lab[..., :1] + 16) / 116 + np.stack(
        [lab[..., 1] / 500, np.zeros(lab.shape[:-1]), -lab[..., 2] / 200], axis=-1
    )
    xyz = _WHITE * np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    return linear_to_srgb(xyz @ _XYZ_TO_RGB.T)


def _arm(hue_near: float, hue_end: float) -> NDArray[np.float64]:
    """CIELAB colours of an arm from zero to its end, [SIZE // 2 + 1, 3].

    Lightness and chroma are the polynomials through the control points `_ARM`.
    """
    place = np.linspace(0, 1, 1025)
    knots = np.linspace(0, 1, len(_ARM))
    degree = len(knots) - 1
    lightness = np.polyval(np.polyfit(knots, _ARM[:, 0], degree), place)
    chroma = np.polyval(np.polyfit(knots, _ARM[:, 1], degree), place)
    hue = np.radians(hue_near + (hue_end - hue_near) * place)
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=1)
    # points of the curve at equal differences of colour (CIE 1976)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lab, axis=0), axis=1))])
    even = np.linspace(0, length[-1], SIZE // 2 + 1)
    return np.stack([np.interp(even, length, column) for column in lab.T], axis=1)
