"""Flexes as in a scene of MuJoCo: corners of the triangles of their faces, edges and vertices.

Corners are float32 [3 m, 8], three for each triangle: point, normal and texture coordinates. Edges
are cylinders without caps, vertices balls, both as thick as the flex's radius.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from .corners import normalized

_SIDES = 20  # of the cylinder of an edge, and of the rings of a vertex's ball
_STACKS = 10  # bands of a vertex's ball, from pole to pole


def flex_parts(
    model: Any, scene: mujoco.MjvScene, drawn: mujoco.MjvGeom
) -> dict[str, NDArray[np.float32]]:
    """Corners of the parts of a flex that MuJoCo draws: of its "faces", "edges" and "vertices".

    The smooth skin of a flex replaces edges and vertices.
    """
    flex = int(drawn.objid)
    radius = float(drawn.size[0])
    smooth = bool(scene.flexskinopt and scene.flexfaceused[flex])
    parts = {}
    if scene.flexfaceused[flex]:
        parts["faces"] = _faces(model, scene, flex)
    if scene.flexedgeopt and radius > 0 and not smooth:
        parts["edges"] = _edges(scene, flex, radius)
    if scene.flexvertopt and radius > 0 and not smooth:
        parts["vertices"] = _balls(_vertices(scene, flex), radius)
    return {name: corners for name, corners in parts.items() if len(corners)}


def _vertices(scene: mujoco.MjvScene, flex: int) -> NDArray[np.float64]:
    first = int(scene.flexvertadr[flex])
    count = int(scene.flexvertnum[flex])
    return scene.flexvert.reshape(-1, 3)[first : first + count].astype(np.float64)


def _faces(model: Any, scene: mujoco.MjvScene, flex: int) -> NDArray[np.float32]:
    first = int(scene.flexfaceadr[flex])
    count = int(scene.flexfaceused[flex])
    corners = slice(3 * first, 3 * (first + count))
    points = scene.flexface.reshape(-1, 3)[corners]
    normals = scene.flexnormal.reshape(-1, 3)[corners]
    uv = scene.flextexcoord.reshape(-1, 2)[corners]
    if model.flex_texcoordadr[flex] < 0:
        uv = np.zeros_like(uv)  # MuJoCo leaves there what was in memory
    return np.concatenate([points, normals, uv], axis=1, dtype=np.float32)


def _edges(scene: mujoco.MjvScene, flex: int, radius: float) -> NDArray[np.float32]:
    first = int(scene.flexedgeadr[flex])
    count = int(scene.flexedgenum[flex])
    ends = _vertices(scene, flex)[scene.flexedge.reshape(-1, 2)[first : first + count]]
    along = normalized(ends[:, 1] - ends[:, 0])
    helper = np.where(np.abs(along[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = normalized(np.cross(helper, along))
    turn = 2 * np.pi * np.arange(_SIDES + 1) / _SIDES
    outwards = (
        np.cos(turn)[:, None] * across[:, None]
        + np.sin(turn)[:, None] * np.cross(along, across)[:, None]
    )  # [edge, side, 3]
    lower = ends[:, :1] + radius * outwards
    upper = ends[:, 1:] + radius * outwards
    return _strips(lower, upper, outwards, outwards)


def _balls(centres: NDArray[np.float64], radius: float) -> NDArray[np.float32]:
    turn = 2 * np.pi * np.arange(_SIDES + 1) / _SIDES
    rise = np.pi * (np.arange(_STACKS + 1) / _STACKS - 0.5)
    flat = np.cos(rise)[:, None, None] * np.stack(
        [np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1
    )
    directions = flat + np.sin(rise)[:, None, None] * [0.0, 0.0, 1.0]  # [level, side, 3]
    rings = centres[:, None, None] + radius * directions
    normals = np.broadcast_to(directions, rings.shape)
    return np.concatenate(
        [
            _strips(rings[:, level], rings[:, level + 1], normals[:, level], normals[:, level + 1])
            for level in range(_STACKS)
        ]
    )


def _strips(
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    lower_normals: NDArray[np.float64],
    upper_normals: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Corners of the bands between pairs of rings [k, sides + 1, 3].

    They are counter-clockwise as seen from outside.
    """

    def corners(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
        a = low[:, :-1]
        b = low[:, 1:]
        c = high[:, 1:]
        d = high[:, :-1]
        return np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3)

    points = corners(lower, upper)
    normals = corners(lower_normals, upper_normals)
    return np.concatenate([points, normals, np.zeros((len(points), 2))], axis=1, dtype=np.float32)
