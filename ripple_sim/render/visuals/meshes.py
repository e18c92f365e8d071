"""Meshes and height fields of a MuJoCo model, with vertex normals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .corners import split_corners
from .primitives import Shape


def mesh_asset(model: Any, mesh: int) -> Shape:
    """Mesh of a MuJoCo model in its geom's frame."""
    first, first_face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    faces = slice(first_face, first_face + model.mesh_facenum[mesh])
    V = np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=np.float64)
    F = np.asarray(model.mesh_face[faces], dtype=np.int64)
    start = model.mesh_texcoordadr[mesh]
    if start < 0:
        return creased(V, F)
    uv = np.asarray(model.mesh_texcoord[start : start + model.mesh_texcoordnum[mesh]], dtype=np.float64)
    return creased(V, F, uv[model.mesh_facetexcoord[faces]])


def height_field(model: Any, hfield: int) -> Shape:
    """Height field of a MuJoCo model with its walls, in its geom's frame."""
    rows, columns = int(model.hfield_nrow[hfield]), int(model.hfield_ncol[hfield])
    half_x, half_y, top, bottom = (float(x) for x in model.hfield_size[hfield])
    start = model.hfield_adr[hfield]
    height = top * np.asarray(model.hfield_data[start : start + rows * columns], dtype=np.float64).reshape(
        rows, columns
    )
    x, y = np.meshgrid(np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows))
    ground = np.stack([x, y, height], axis=2).reshape(-1, 3)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    F = [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    # round the rim, counter-clockwise from above
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    foot = len(ground) + np.arange(len(rim))
    after, foot_after = np.roll(rim, -1), np.roll(foot, -1)
    F += [np.stack([rim, foot, foot_after], axis=1), np.stack([rim, foot_after, after], axis=1)]
    return creased(np.concatenate([ground, ground[rim] * [1, 1, 0] - [0, 0, bottom]]), np.concatenate(F))


def creased(V: NDArray, F: NDArray, corner_uv: NDArray | None = None) -> Shape:
    """Mesh of a fixed size, its vertices split where normals or texture coordinates [m, 3, 2] jump."""
    split = split_corners(V, F, corner_uv)
    positions = V[split.vertices]
    return Shape(np.zeros_like(positions), positions, split.normals, split.F, None if corner_uv is None else split.uv)
