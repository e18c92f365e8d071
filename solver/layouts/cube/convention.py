"""The equiangular cube map: where the texels of six N x N charts lie on the sphere, and how the charts are connected.

Chart order is +x, -x, +y, -y, +z, -z. A chart has a normal n and two axes u (columns) and v (rows) with u x v = n.
Texel (chart, row, column) looks along n + tan(pi/4 a) u + tan(pi/4 b) v with a = (2 column + 1)/N - 1 and
b = (2 row + 1)/N - 1, so that texels are equally wide in angle along both axes. A grid line that leaves a chart goes on
as a grid line of the next one.
"""

from __future__ import annotations

import functools
import numbers

import numpy as np
from numpy.typing import NDArray

from ...errors import AtlasError
from ...files import require_memory
from ...texels.glue import glue
from ...texels.topology import TexelTopology

CHART_NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
CHART_U = np.array([[0, 1, 0], [0, -1, 0], [-1, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0]])
CHART_V = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 1, 0], [0, -1, 0]])

MIN_RESOLUTION = 4
MAX_RESOLUTION = 4096

# Memory for each texel while an atlas is built, at least [bytes].
_TEXEL = 200


def check_resolution(resolution: int) -> int:
    """Return the resolution N as an int, or raise `AtlasError` if it is not a whole number in the valid range."""
    whole = isinstance(resolution, numbers.Real) and resolution % 1 == 0
    if not whole or not MIN_RESOLUTION <= resolution <= MAX_RESOLUTION:
        raise AtlasError(
            f"resolution is {resolution!r}; valid is a whole number of texels along a chart's side "
            f"from {MIN_RESOLUTION} to {MAX_RESOLUTION}"
        )
    return int(resolution)


def check_memory(resolution: int) -> None:
    """Raise `AtlasError` if an atlas of about 6 N^2 texels cannot fit into memory."""
    what = f"an atlas of resolution {resolution}"
    require_memory(AtlasError, _TEXEL * 6 * resolution**2, what, "take a lower resolution")


def texel_directions(resolution: int) -> NDArray[np.float64]:
    """Unit vectors through the texel centres, shape [6, N, N, 3]."""
    half_width = resolution
    offset = 2 * np.arange(resolution) + 1 - half_width
    # tan is evaluated once per distance from the chart's middle, so that mirrored texels are mirrored to the last bit
    tangent = np.sign(offset) * np.tan(np.pi / 4 * np.abs(offset) / half_width)
    a = tangent[None, None, :, None]
    b = tangent[None, :, None, None]
    directions = CHART_NORMALS[:, None, None, :] + a * CHART_U[:, None, None, :] + b * CHART_V[:, None, None, :]
    # the sum of squares in one order for all charts, for the same reason
    return directions / np.sqrt(1.0 + np.minimum(a * a, b * b) + np.maximum(a * a, b * b))


def cube_chart_points(
    directions: NDArray[np.float64], resolution: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Chart, row and column of directions from the cube's centre (they need not be unit vectors).

    Row and column are float64 in texel units; 0.0 is the centre of the first texel. Each result has shape [k].
    """
    d = np.asarray(directions, dtype=np.float64).reshape(-1, 3)
    axis = np.argmax(np.abs(d), axis=1)
    main = np.take_along_axis(d, axis[:, None], axis=1)[:, 0]
    chart = 2 * axis + (main < 0)
    a = np.arctan(np.einsum("ij,ij->i", d, CHART_U[chart]) / np.abs(main)) * (4 / np.pi)
    b = np.arctan(np.einsum("ij,ij->i", d, CHART_V[chart]) / np.abs(main)) * (4 / np.pi)
    return chart, ((b + 1) * resolution - 1) / 2, ((a + 1) * resolution - 1) / 2


@functools.lru_cache(maxsize=8)
def cube_topology(resolution: int) -> TexelTopology:
    """The six charts of N x N texels, glued along the edges of the cube; at its eight corners three charts meet."""
    # outward from a chart's south, east, north and west side
    outward = np.stack([-CHART_V, CHART_U, CHART_V, -CHART_U], axis=1)
    beyond = (outward[:, :, None] == CHART_NORMALS).all(axis=-1).argmax(axis=-1)
    # the neighbour's side on which this chart lies
    back = (outward[beyond] == CHART_NORMALS[:, None, None]).all(axis=-1).argmax(axis=-1)
    return glue(np.stack([beyond, back], axis=-1), resolution)


@functools.lru_cache(maxsize=1)
def cube_rotations() -> NDArray[np.float64]:
    """The 24 rotations that map the cube onto itself, shape [24, 3, 3]."""
    rotations = []
    for first in range(6):
        for second in range(6):
            x, y = CHART_NORMALS[first], CHART_NORMALS[second]
            if x @ y == 0:
                rotations.append(np.stack([x, y, np.cross(x, y)], axis=1))
    return np.array(rotations, dtype=np.float64)


def permute_texels(field: NDArray, transform: NDArray[np.float64]) -> NDArray:
    """Move a field [6, N, N, ...] by one of the cube's 48 symmetries (a 3 x 3 signed permutation matrix).

    The result r satisfies r(transform @ d) = field(d) for the texel directions d.
    """
    n = field.shape[1]
    directions = texel_directions(n).reshape(-1, 3)
    chart, row, column = cube_chart_points(directions @ transform.T, n)
    flat = (chart * n + np.rint(row).astype(int)) * n + np.rint(column).astype(int)
    result = np.empty_like(field)
    result.reshape(6 * n * n, *field.shape[3:])[flat] = field.reshape(6 * n * n, *field.shape[3:])
    return result
