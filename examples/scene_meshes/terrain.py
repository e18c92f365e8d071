"""The shipped landscape: heights on a grid, as MuJoCo reads them.

`python examples/scene_meshes/terrain.py` writes `scenes/meshes/terrain.bin` again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ripple_sim.scenes.shapes import Array

TERRAIN_FILE = Path(__file__).parents[2] / "scenes" / "meshes" / "terrain.bin"

_HILLS = (
    (-0.55, 0.45, 0.30, 1.0),
    (0.65, 0.55, 0.32, 0.8),
    (-0.75, -0.55, 0.28, 0.5),
    (0.60, -0.70, 0.26, 0.45),
)


def terrain(size: int = 64) -> Array:
    """Heights [size, size], 0 to 1: four hills round a valley.

    Rows go along y and columns along x, both from -1 to 1.
    """
    x, y = np.meshgrid(*[np.linspace(-1, 1, size)] * 2)
    height = 0.25 * (x * x + y * y) + 0.04 * np.sin(5 * x + 1) * np.cos(4 * y)
    for east, north, width, top in _HILLS:
        height += top * np.exp(-((x - east) ** 2 + (y - north) ** 2) / (2 * width**2))
    return (height - height.min()) / np.ptp(height)


def write(path: Path = TERRAIN_FILE) -> None:
    """Write MuJoCo's format of height fields: rows and columns as int32, heights as float32."""
    heights = terrain()
    path.write_bytes(np.array(heights.shape, "<i4").tobytes() + heights.astype("<f4").tobytes())


if __name__ == "__main__":
    write()
