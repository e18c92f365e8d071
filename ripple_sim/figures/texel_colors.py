"""Colours of an atlas's texels: by stretch, and by chart."""

from __future__ import annotations

import colorsys

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, TexelTopology, sphere_atlas

# Finer than an even spread is blue, coarser is red; the ends stand for a factor of 2.
STRETCH_COLORS = LinearSegmentedColormap.from_list(
    "stretch", ["#1f4e8c", "#3f8fc0", "#8fd0d4", "#f6f1df", "#f4b46f", "#dd6247", "#8c1d40"], N=512
)
STRETCH_RANGE = 2.0
_HUES = 12


def texel_stretch(atlas: Atlas) -> NDArray[np.float64]:
    """Stretch at every texel, [C, n, n]: sqrt(real area over even share).

    In the cube layout the even share is that of the texel on the sphere, in others the same for all texels.
    """
    share = sphere_atlas(1.0, atlas.resolution).areas if atlas.layout == "cube" else np.ones_like(atlas.areas)
    return np.sqrt((atlas.areas / atlas.areas.sum()) / (share / share.sum()))


def stretch_shade(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place on the colour scale, 0 to 1."""
    return np.clip(0.5 + 0.5 * np.log(stretch) / np.log(STRETCH_RANGE), 0, 1)


def stretch_colors(stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours [..., 3] of stretches."""
    return STRETCH_COLORS(stretch_shade(stretch))[..., :3]


def chart_colors(topology: TexelTopology) -> NDArray[np.float64]:
    """A pale colour for each chart, [C, 3], never that of a chart beside it."""
    hues = np.full(len(topology.glued), -1)
    meeting: list[set[int]] = [set() for _ in range(int(topology.corners.max()) + 1)]
    for chart, corners in enumerate(topology.corners.tolist()):
        for corner in corners:
            meeting[corner].add(chart)
    for chart, corners in enumerate(topology.corners.tolist()):
        near = {int(hues[other]) for corner in corners for other in meeting[corner]}
        # steps of 5 hues of 12 visit all of them, far from each other
        free = [hue for hue in (5 * (chart + k) % _HUES for k in range(_HUES)) if hue not in near]
        hues[chart] = free[0] if free else chart % _HUES
    return np.array([colorsys.hls_to_rgb(hue / _HUES, 0.74 - 0.08 * (hue % 2), 0.62) for hue in hues.tolist()])
