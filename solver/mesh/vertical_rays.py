"""Heights of a mesh seen from above."""

from __future__ import annotations

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray


def downward_hits(V: NDArray[np.float64], F: NDArray[np.int64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height [m] at which vertical rays from above at xy [k, 2] first meet a mesh; NaN where they miss. Shape [k]."""
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, V.astype(np.float32), F.astype(np.int32))
    top = V[:, 2].max() + np.ptp(V, axis=0).max()
    origins = np.column_stack([xy, np.full(len(xy), top)]).astype(np.float32)
    down = np.tile(np.array([0, 0, -1], dtype=np.float32), (len(xy), 1))
    hit = scene.run(origins, down, output=1)
    return np.where(hit["primID"] >= 0, top - hit["tfar"], np.nan)
