"""What a renderer needs of the waves: height and surface gradient of every texel, with a halo for interpolation."""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import NDArray

from ..backends.device_field import DeviceField
from ..errors import SolverError
from ..files import require_memory
from ..gl import GLContext
from ..kept import kept_with
from ..kernel import Floats32, kernel
from ..texels.atlas import Atlas
from ..texels.halo import fill_halo
from ..texels.texel_mesh import TexelMesh
from ..texels.topology import TexelTopology
from .device_height_map import DeviceHeightMap, HeightMapShaders
from .displacement_limit import DisplacementLimit

# Weight of the second-order terms' regularisation, relative to the squared distances that they multiply.
_REGULARISATION = 1e-4

# Memory for each texel that is kept [bytes], and texels whose weights are fitted at a time: that takes 1,400 each.
_TEXEL, _BLOCK = 110, 16_384


class HeightMap:
    """Turns a height field into a texture of gradient and height.

    The gradient at a texel is that of the quadratic that fits the eight neighbours' heights best, in the tangent plane:
    second-order accurate also where grid lines kink at the borders and corners of charts, so that shading shows none.

    Parameters
    ----------
    texels : TexelMesh
    limit : DisplacementLimit, optional
        Of the heights; the gradient is that of the limited ones. By default there is none.
    """

    def __init__(self, texels: TexelMesh, limit: DisplacementLimit | None = None) -> None:
        self._topology = texels.topology
        self._limit = limit
        count = texels.positions[..., 0].size
        require_memory(SolverError, _TEXEL * count, f"the height map of {count:,} texels", "take a lower resolution")
        self._weights = _gradient_weights(texels)
        self._shaders: HeightMapShaders | None = None

    @classmethod
    def drawn(cls, atlas: Atlas, limit: bool = True) -> HeightMap:
        """Height map for drawing the surface of an atlas: with its `DisplacementLimit`, unless that is turned off."""
        return cls(atlas.texels, DisplacementLimit(atlas) if limit else None)

    @overload
    def __call__(self, height: NDArray[np.float32]) -> NDArray[np.float32]: ...

    @overload
    def __call__(self, height: DeviceField) -> DeviceHeightMap: ...

    def __call__(self, height: NDArray[np.float32] | DeviceField) -> NDArray[np.float32] | DeviceHeightMap:
        """Height map of a height field.

        Parameters
        ----------
        height : float32 [C, n, n]
            [m]. Or one that is on the GPU: then so is the height map, made where it is drawn.

        Returns
        -------
        float32 [C, n + 2, n + 2, 4]
            Gradient of the height in the frame of the mesh (tangent to the surface, dimensionless), and the height
            [m]. For the halo see `fill_halo`; beyond a fixed rim lie the negative heights, so that those drawn come
            to 0 at the rim.
        """
        if isinstance(height, DeviceField):
            return DeviceHeightMap(self._shaders_on(height.gl), height, self)
        around = np.zeros(self._topology.halo.shape, np.float32)
        around[:, 1:-1, 1:-1] = height if self._limit is None else self._limit(height)
        fill_halo(self._topology, around)
        height_map = np.zeros((*around.shape, 4), np.float32)
        _differentiate(self._weights, around, height_map)
        fill_halo(self._topology, height_map)
        mirror_at_rim(self._topology, height_map)
        return height_map

    def rates(self, height: NDArray[np.float32], velocity: NDArray[np.float32]) -> NDArray[np.float32]:
        """Rate of the heights in the height map [m/s], [C, n + 2, n + 2], under a height and a velocity [C, n, n]."""
        rates = np.zeros((*self._topology.halo.shape, 4), np.float32)
        rates[:, 1:-1, 1:-1, 3] = velocity if self._limit is None else self._limit.rate(height, velocity)
        fill_halo(self._topology, rates)
        mirror_at_rim(self._topology, rates)
        return rates[..., 3]

    def _shaders_on(self, gl: GLContext) -> HeightMapShaders:
        if self._shaders is None:
            self._shaders = HeightMapShaders(gl, self._topology, self._weights, self._limit)
        return self._shaders


def mirror_at_rim(topology: TexelTopology, height_map: NDArray[np.float32]) -> None:
    """Fill in what lies beyond a fixed rim, if there is one: the texels' mirror image, with heights turned over."""
    if not topology.fixed_rim:
        return
    turned = np.array([1, 1, 1, -1], np.float32)
    height_map[topology.rim] = height_map[:, 1:-1, 1:-1].reshape(-1, 4)[topology.halo[topology.rim]] * turned
    last = height_map.shape[1] - 1
    for corner, (r, c) in enumerate(((0, 0), (0, last), (last, last), (last, 0))):
        # the four places round a corner in the rim have a mean height of 0
        r_in, c_in = abs(r - 1), abs(c - 1)
        ends = topology.valence[:, corner] == 0
        heights = height_map[ends, ..., 3]
        height_map[ends, r, c, 3] = -(heights[:, r_in, c_in] + heights[:, r_in, c] + heights[:, r, c_in])


# the eight neighbours (row, column) in the order of the gradient weights
_AROUND = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


@kept_with
def _gradient_weights(texels: TexelMesh) -> NDArray[np.float32]:
    """Vectors g with gradient = sum over the 8 neighbours of g (h_j - h_i), shape [C n^2, 8, 3] in [1/m]."""
    around = texels.halo_positions.copy()
    if not texels.topology.fixed_rim:
        # beyond a free rim the halo repeats heights: nothing is known there; a fixed one's own points are at 0
        around[texels.topology.rim] = np.nan
    normals = texels.normals.reshape(-1, 3)
    weights = np.empty((len(normals), 8, 3), np.float32)
    for first in range(0, len(normals), _BLOCK):
        block = np.arange(first, min(first + _BLOCK, len(normals)))
        weights[block] = _fit(around, block, normals[block])
    return weights


def _fit(around: NDArray[np.float64], texels: NDArray[np.int64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same vectors of some texels [k], from all positions with halo and the texels' normals: [k, 8, 3]."""
    n = around.shape[1] - 2
    f, r, c = np.unravel_index(texels, (len(around), n, n))
    center = around[f, r + 1, c + 1]
    tangent = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    offset = np.stack([around[f, r + 1 + down, c + 1 + right] - center for down, right in _AROUND], axis=1)
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


@kernel
def _differentiate(weights: Floats32, h: Floats32, height_map: Floats32) -> None:
    """Fill in gradient and height, [C, n + 2, n + 2, 4], of the texels of a field with halo, [C, n + 2, n + 2]."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
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
