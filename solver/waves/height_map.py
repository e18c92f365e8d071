"""What a renderer needs of the waves: the height and its surface gradient at every texel, padded for interpolation."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.halo import padded_addresses

# Weight of the second-order terms' regularisation, relative to the squared distances that they multiply.
_REGULARISATION = 1e-4


class HeightMap:
    """Turns a height field into a texture of gradient and height.

    The gradient at a texel is that of the quadratic that fits the eight neighbours' heights best, in the tangent plane:
    second-order accurate also where grid lines kink at the cube's edges and corners, so that shading shows no edge.

    Parameters
    ----------
    atlas : Atlas
    """

    def __init__(self, atlas: Atlas) -> None:
        n = atlas.resolution
        self._n = n
        self._weights = _gradient_weights(atlas).astype(np.float32)
        self._inside, self._ring, self._source = padded_addresses(n)

    def __call__(self, height: NDArray[np.float32]) -> NDArray[np.float32]:
        """HeightMap of a height field.

        Parameters
        ----------
        height : float32 [6, N, N]
            [m].

        Returns
        -------
        float32 [6, N + 2, N + 2, 4]
            Gradient of the height in the frame of the mesh (tangent to the surface, dimensionless), and the height
            [m]. The ring holds the neighbours' texels; its corners hold the mean of the three texels that meet there,
            which makes bilinear interpolation continuous all over the cube.
        """
        n = self._n
        padded = np.zeros((6, n + 2, n + 2), np.float32)
        padded[:, 1:-1, 1:-1] = height
        heights = padded.reshape(-1)
        heights[self._ring] = heights[self._source]
        height_map = np.empty((6, n + 2, n + 2, 4), np.float32)
        _differentiate(self._weights, padded, height_map)
        texels = height_map.reshape(-1, 4)
        texels[self._ring] = texels[self._source]
        for r, r_in, r_out in ((0, 1, 0), (n + 1, n, n + 1)):
            for c, c_in, c_out in ((0, 1, 0), (n + 1, n, n + 1)):
                height_map[:, r, c] = (
                    height_map[:, r_in, c_in] + height_map[:, r_in, c_out] + height_map[:, r_out, c_in]
                ) / 3
        return height_map


# the eight neighbours (row, column) in the order of the gradient weights
_AROUND = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


def _gradient_weights(atlas: Atlas) -> NDArray[np.float64]:
    """Vectors g with gradient = sum over the 8 neighbours of g (h_j - h_i), shape [6 N^2, 8, 3] in [1/m]."""
    n = atlas.resolution
    padded = atlas.padded_positions
    center = atlas.positions.reshape(-1, 3)
    normal = atlas.normals.reshape(-1, 3)
    tangent = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    offset = np.stack(
        [padded[:, 1 + r : n + 1 + r, 1 + c : n + 1 + c].reshape(-1, 3) - center for r, c in _AROUND], axis=1
    )
    exists = np.isfinite(offset[..., :1])
    offset = np.where(exists, offset, 0.0)
    scale = np.sqrt((offset**2).sum(axis=(1, 2)) / exists.sum(axis=(1, 2)))[:, None]
    scale = np.maximum(scale, np.finfo(np.float64).tiny)
    x = np.einsum("ijk,ik->ij", offset, tangent) / scale
    y = np.einsum("ijk,ik->ij", offset, bitangent) / scale
    design = np.stack([x, y, x * x / 2, x * y, y * y / 2], axis=-1) * exists
    normal_matrix = np.einsum("ijk,ijl->ikl", design, design)
    normal_matrix += _REGULARISATION * np.diag([1e-3, 1e-3, 1, 1, 1])
    fit = np.linalg.solve(normal_matrix, np.swapaxes(design, 1, 2))[:, :2] / scale[:, :, None]
    return fit[:, 0, :, None] * tangent[:, None, :] + fit[:, 1, :, None] * bitangent[:, None, :]


@numba.njit(cache=True, nogil=True)
def _differentiate(weights, h, height_map):
    n = h.shape[1] - 2
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            g = weights[i * n + c - 1]
            here = h[f, r, c]
            gx = gy = gz = np.float32(0)
            for k in range(8):
                step = h[f, r + _AROUND[k][0], c + _AROUND[k][1]] - here
                gx += g[k, 0] * step
                gy += g[k, 1] * step
                gz += g[k, 2] * step
            height_map[f, r, c, 0] = gx
            height_map[f, r, c, 1] = gy
            height_map[f, r, c, 2] = gz
            height_map[f, r, c, 3] = here
