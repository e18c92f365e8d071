"""The equiangular cube map: where the texels of six N x N faces lie on the sphere, and which texels are neighbours.

Face order is +x, -x, +y, -y, +z, -z. A face has a normal n and two axes u (columns) and v (rows) with u x v = n. Texel
(face, row, column) looks along n + tan(pi/4 a) u + tan(pi/4 b) v with a = (2 column + 1)/N - 1 and
b = (2 row + 1)/N - 1, so that texels are equally wide in angle along both axes. A grid line that leaves a face goes on
as a grid line of the next one.
"""

from __future__ import annotations

import functools
import numbers

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import AtlasError

FACE_NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
FACE_U = np.array([[0, 1, 0], [0, -1, 0], [-1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]])
FACE_V = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 1, 0], [0, -1, 0]])

MIN_RESOLUTION = 4
MAX_RESOLUTION = 4096


def check_resolution(resolution: int) -> int:
    """Return the resolution N as an int, or raise `AtlasError` if it is not a whole number in the valid range."""
    whole = isinstance(resolution, numbers.Real) and resolution % 1 == 0
    if not whole or not MIN_RESOLUTION <= resolution <= MAX_RESOLUTION:
        raise AtlasError(
            f"resolution is {resolution!r}; valid is a whole number of texels per face edge "
            f"from {MIN_RESOLUTION} to {MAX_RESOLUTION}"
        )
    return int(resolution)


def texel_directions(resolution: int) -> NDArray[np.float64]:
    """Unit vectors through the texel centres, shape [6, N, N, 3]."""
    half_width = resolution
    offset = 2 * np.arange(resolution) + 1 - half_width
    # tan is evaluated once per distance from the face's middle, so that mirrored texels are mirrored to the last bit
    tangent = np.sign(offset) * np.tan(np.pi / 4 * np.abs(offset) / half_width)
    a = tangent[None, None, :, None]
    b = tangent[None, :, None, None]
    directions = FACE_NORMALS[:, None, None, :] + a * FACE_U[:, None, None, :] + b * FACE_V[:, None, None, :]
    # the sum of squares in one order for all faces, for the same reason
    return directions / np.sqrt(1.0 + np.minimum(a * a, b * b) + np.maximum(a * a, b * b))


def face_coordinates(
    directions: NDArray[np.float64], resolution: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Face, row and column of directions from the cube's centre (they need not be unit vectors).

    Row and column are float64 in texel units; 0.0 is the centre of the first texel. Each result has shape [k].
    """
    d = np.asarray(directions, dtype=np.float64).reshape(-1, 3)
    axis = np.argmax(np.abs(d), axis=1)
    main = np.take_along_axis(d, axis[:, None], axis=1)[:, 0]
    face = 2 * axis + (main < 0)
    a = np.arctan(np.einsum("ij,ij->i", d, FACE_U[face]) / np.abs(main)) * (4 / np.pi)
    b = np.arctan(np.einsum("ij,ij->i", d, FACE_V[face]) / np.abs(main)) * (4 / np.pi)
    return face, ((b + 1) * resolution - 1) / 2, ((a + 1) * resolution - 1) / 2


@functools.lru_cache(maxsize=8)
def padded_indices(resolution: int) -> NDArray[np.int64]:
    """Flat texel index of every cell of the faces padded by one texel, shape [6, N + 2, N + 2].

    The ring holds the texels across the face's edges. At the eight cube corners three faces meet and a fourth texel
    does not exist: the ring's corners are -1.
    """
    n = resolution
    offset = 2 * np.arange(-1, n + 1) + 1 - n
    a, b = np.broadcast_arrays(offset[None, :], offset[:, None])
    padded = np.full((6, n + 2, n + 2), -1, dtype=np.int64)
    for face in range(6):
        # Integer lattice points of the cube [-N, N]^3. A point that overhangs along u by one is folded round the edge.
        overhang_a, overhang_b = np.abs(a) > n, np.abs(b) > n
        valid = ~(overhang_a & overhang_b)
        depth = np.where(overhang_a | overhang_b, n - 1, n)
        point = (
            depth[..., None] * FACE_NORMALS[face]
            + np.clip(a, -n, n)[..., None] * FACE_U[face]
            + np.clip(b, -n, n)[..., None] * FACE_V[face]
        )
        padded[face][valid] = _lattice_index(point[valid], n)
    padded.setflags(write=False)
    return padded


def _lattice_index(point: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    axis = np.argmax(np.abs(point), axis=1)
    sign = np.take_along_axis(point, axis[:, None], axis=1)[:, 0] < 0
    face = 2 * axis + sign
    column = (np.einsum("ij,ij->i", point, FACE_U[face]) + n - 1) // 2
    row = (np.einsum("ij,ij->i", point, FACE_V[face]) + n - 1) // 2
    return (face * n + row) * n + column


@functools.lru_cache(maxsize=1)
def cube_rotations() -> NDArray[np.float64]:
    """The 24 rotations that carry the cube onto itself, shape [24, 3, 3]."""
    rotations = []
    for first in range(6):
        for second in range(6):
            x, y = FACE_NORMALS[first], FACE_NORMALS[second]
            if x @ y == 0:
                rotations.append(np.stack([x, y, np.cross(x, y)], axis=1))
    return np.array(rotations, dtype=np.float64)


def permute_texels(field: NDArray, transform: NDArray[np.float64]) -> NDArray:
    """Carry a field [6, N, N, ...] along one of the cube's 48 symmetries (a 3 x 3 signed permutation matrix).

    The result r satisfies r(transform @ d) = field(d) for the texel directions d.
    """
    n = field.shape[1]
    directions = texel_directions(n).reshape(-1, 3)
    face, row, column = face_coordinates(directions @ transform.T, n)
    flat = (face * n + np.rint(row).astype(int)) * n + np.rint(column).astype(int)
    result = np.empty_like(field)
    result.reshape(6 * n * n, *field.shape[3:])[flat] = field.reshape(6 * n * n, *field.shape[3:])
    return result
