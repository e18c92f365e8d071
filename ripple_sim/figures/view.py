"""A look at a surface: where the eye is, a soft light, and images averaged from finer pixels."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

OVERSAMPLING = 2  # finer pixels along each side of a pixel
_LIGHT = np.array([-0.45, 0.55, 0.7]) / np.linalg.norm([-0.45, 0.55, 0.7])  # to the right, up, to the eye


@dataclasses.dataclass(frozen=True)
class View:
    """An orthographic look at a surface.

    Attributes
    ----------
    azimuth, elevation : float
        Where the eye is [degrees]; azimuth 0 looks along the negative forward axis, which points out of the screen.
    up : str
        Axis of the mesh's file that points up: "y" or "z".
    """

    azimuth: float = 35.0
    elevation: float = 18.0
    up: str = "y"

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors to the right, up and towards the eye, as rows, shape [3, 3]."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        eye = np.array([np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)])
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        axes = np.stack([right, np.cross(eye, right), eye])
        return axes if self.up == "y" else axes[:, [0, 2, 1]] * [1.0, -1.0, 1.0]


def lit(
    colors: NDArray[np.float64], normals: NDArray[np.float64], openness: NDArray[np.float64], view: View
) -> NDArray[np.float64]:
    """Colours under a soft light from the upper left, with a little sheen; flat enough for colours to be read."""
    local = normals @ view.axes.T
    local /= np.maximum(np.linalg.norm(local, axis=1, keepdims=True), 1e-9)
    diffuse = 0.5 + 0.5 * local @ _LIGHT
    half = _LIGHT + np.array([0.0, 0.0, 1.0])
    sheen = np.maximum(local @ (half / np.linalg.norm(half)), 0) ** 40
    shade = (0.42 + 0.68 * diffuse) * (0.45 + 0.55 * openness)
    return np.clip(colors * shade[:, None] + 0.10 * (sheen * openness)[:, None], 0, 1)


def screen(size: int, half_width: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places x and y of the pixels of a square from -half_width to half_width, row 0 at the top."""
    place = ((np.arange(size) + 0.5) / size * 2 - 1) * half_width
    y, x = np.meshgrid(place[::-1], place, indexing="ij")
    return x, y


def antialiased(shape: tuple[int, ...], seen: NDArray[np.int64], colors: NDArray[np.float64]) -> NDArray[np.float64]:
    """RGBA image, averaged over the oversampling, of colours [k, 3] at the pixels `seen`."""
    fine = np.zeros((shape[0] * shape[1], 4))
    fine[seen, :3], fine[seen, 3] = colors, 1.0
    k = OVERSAMPLING
    coarse = fine.reshape(shape[0] // k, k, shape[1] // k, k, 4).mean(axis=(1, 3))
    # colours are summed where something is seen only: undo the dilution, which alpha already expresses
    coarse[..., :3] /= np.maximum(coarse[..., 3:], 1e-9)
    return np.clip(coarse, 0, 1)
