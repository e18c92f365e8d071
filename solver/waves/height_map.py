"""Height maps for a renderer: height and surface gradient of every texel, with a halo.

The halo is for interpolation. Drawn heights have a limit, so that a surface with high waves does
not pass through itself. Where the heights are on the GPU, the height map is written into the
renderer's texture without leaving the GPU.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, overload

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..backends.gl_fields import DeviceField, bind_buffers
from ..cache import kept_with
from ..errors import SolverError
from ..gl import GLContext
from ..kernel import Floats32, kernel
from ..memory import require_memory
from ..texels.atlas import Atlas
from ..texels.chart_page import ChartPage
from ..texels.halo import fill_halo
from ..texels.texel_mesh import TexelMesh
from ..texels.thickness import MIN_MEDIAL_RADIUS, medial_radius
from ..texels.topology import TexelTopology

# Shares of the medial radius: heights up to the first share are drawn as they are, and no height is
# drawn beyond the second share. The shaders have constants of the same names.
FREE_SHARE = 0.25
MAX_SHARE = 0.6

# Largest height in medial radii that enters the hyperbolic tangent, which is 1 far below it:
# float32 would overflow otherwise.
_MAX_RADII = 1e3

_GROUP = 256  # threads of a group of a compute shader
_SOLVER_PACKAGE = "ripple_sim.solver"  # below which the shaders lie

# An entry of the table of sources where no texel lies. Lower entries are mirror images: -2 - t is
# the mirror image of texel t.
_NO_TEXEL = -1

# Regularisation of the second-order terms, relative to the squared distances that they multiply;
# and of the first-order terms, relative to that of the second-order terms.
_REGULARISATION = 1e-4
_FIRST_ORDER_SHARE = 1e-3

# The tangent is perpendicular to the x axis unless the normal has at least this x component; then
# it is perpendicular to the y axis.
_MAX_ALONG_X = 0.6

_TEXEL_BYTES = 110  # memory that a height map keeps for each texel
_FITTED_TEXELS = 16_384  # texels whose weights are fitted together: 1,400 bytes each

# The eight neighbours (row, column) in the order of the gradient weights.
_AROUND = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


class DisplacementLimit:
    """Reduces heights that are large beside the object's local radius; leaves other heights alone.

    With R the medial radius at a texel (see `medial_radius`), a height h is drawn as it is up to R
    / 4. Beyond, it is drawn as R (a + (b - a) tanh((|h| / R - a) / (b - a))) with its sign, a = 1/4
    and b = 0.6: twice continuously differentiable, growing with h, and never more than 0.6 R. The
    waves themselves are not limited.
    """

    def __init__(self, atlas: Atlas) -> None:
        self._atlas = atlas
        self._always_free = (
            FREE_SHARE * MIN_MEDIAL_RADIUS * float(np.ptp(atlas.mesh.V, axis=0).max())
        )

    @functools.cached_property
    def radius(self) -> NDArray[np.float32]:
        """The medial radius R [m], [C, n, n]; slow to compute, and not needed by most waves."""
        return medial_radius(self._atlas)

    def may_bend(self, highest: float) -> bool:
        """Whether heights of at most this size [m] may be reduced."""
        return highest > self._always_free

    def __call__(self, height: NDArray[np.float32]) -> NDArray[np.float32]:
        """The heights to draw [m], float32 [C, n, n]; the same array if all are below the limit."""
        high, radius, beyond = self._beyond(height)
        if not len(radius):
            return height
        drawn = height.copy()
        drawn[high] = (
            np.sign(height[high])
            * radius
            * (FREE_SHARE + (MAX_SHARE - FREE_SHARE) * np.tanh(beyond))
        )
        return drawn

    def rate(
        self, height: NDArray[np.float32], velocity: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Rate of the heights to draw [m/s], float32 [C, n, n], of heights with a velocity."""
        high, radius, beyond = self._beyond(height)
        if not len(radius):
            return velocity
        rate = velocity.copy()
        rate[high] *= 1 - np.tanh(beyond) ** 2
        return rate

    def _beyond(self, height: NDArray[np.float32]) -> tuple[NDArray[np.bool_], NDArray, NDArray]:
        """The reduced heights: where they are, and two values for each of them.

        Returns a mask [C, n, n], the medial radius [m] [k], and the argument of the hyperbolic
        tangent [k].
        """
        size = np.abs(height)
        if not self.may_bend(float(size.max())):
            none_bent = np.zeros(height.shape, np.bool_)
            nothing = np.empty(0, np.float32)
            return none_bent, nothing, nothing
        radii = size / self.radius
        high = radii > FREE_SHARE
        argument = (np.minimum(radii[high], _MAX_RADII) - FREE_SHARE) / (MAX_SHARE - FREE_SHARE)
        return high, self.radius[high], argument


class HeightMapShaders:
    """Turns heights into height maps on the GPU, see `HeightMap`.

    `weights` [C n^2, 8, 3] are those of the gradients.
    """

    def __init__(
        self,
        gl: GLContext,
        topology: TexelTopology,
        weights: NDArray[np.float32],
        limit: DisplacementLimit | None,
    ) -> None:
        self._gl = gl
        self._limit = limit
        self.shape = (*topology.halo.shape, 4)
        charts, n, _ = topology.shape
        sources, means, ends = halo_sources(topology)
        self._place_count = sources.size
        self._corner_counts = (len(means), len(means) + len(ends))
        defines = {
            "GROUP": _GROUP,
            "N": n,
            "COLUMNS": ChartPage(charts, n).columns,
            "FREE_SHARE": FREE_SHARE,
            "MAX_SHARE": MAX_SHARE,
        }
        shader = functools.partial(gl.compute_shader, _SOLVER_PACKAGE, **defines)
        with gl as ctx:
            self._heights = shader("waves/shaders/halo_heights")
            self._limited = shader("waves/shaders/halo_heights", LIMIT=1)
            self._map = shader("waves/shaders/height_map")
            self._corners = shader("waves/shaders/height_map", CORNERS=1)
            self._sources = ctx.buffer(sources.tobytes())
            self._corner_places = ctx.buffer(np.concatenate([means, ends]).tobytes() or bytes(16))
            self._weights = ctx.buffer(weights.tobytes())
            self._around = ctx.buffer(bytes(4 * sources.size))
            self._peak = ctx.buffer(bytes(4))
        self._radii: moderngl.Buffer | None = None

    def fill(self, field: DeviceField, texture: moderngl.TextureArray, layer: int) -> float:
        """Write the height map's page into a layer of a texture, RGBA32F.

        Returns the largest height drawn [m]. Raises `SolverError` if a height is not finite.
        """
        highest = field.peak
        if not np.isfinite(highest):
            raise SolverError(
                "heights to be drawn are no longer finite; a source was too large for float32: "
                "make it smaller and `reset()` the waves"
            )
        limit = self._limit
        limited = limit is not None and limit.may_bend(highest)
        with self._gl as ctx:
            if limit is not None and limited:
                self._peak.write(bytes(4))
                self._radii = self._radii or ctx.buffer(limit.radius.tobytes())
            bind_buffers(self._around, self._peak, self._sources, field.buffer, self._radii)
            self._run(ctx, self._limited if limited else self._heights, self._place_count)
            texture.bind_to_image(0, read=True, write=True)
            bind_buffers(self._around, self._weights, self._sources)
            self._map["layer"] = layer
            self._run(ctx, self._map, self._place_count)
            bind_buffers(self._corner_places)
            mean_count, corner_count = self._corner_counts
            self._corners["layer"] = layer
            self._corners["means"] = mean_count
            self._corners["count"] = corner_count
            self._run(ctx, self._corners, corner_count)
            return float(np.frombuffer(self._peak.read(), np.float32)[0]) if limited else highest

    def _run(self, ctx: moderngl.Context, shader: moderngl.ComputeShader, count: int) -> None:
        if count:
            shader.run(-(-count // _GROUP))
            ctx.memory_barrier()


class DeviceHeightMap:
    """The height map of a field on the GPU, which is computed where it is drawn.

    `numpy.asarray` gives the array that `HeightMap` gives, [C, n + 2, n + 2, 4].
    """

    def __init__(
        self, shaders: HeightMapShaders, field: DeviceField, on_host: Callable[[NDArray], NDArray]
    ) -> None:
        self._shaders = shaders
        self._field = field
        self._on_host = on_host
        self.gl = field.gl
        self.shape = shaders.shape

    def fill(self, texture: moderngl.TextureArray, layer: int) -> float:
        """Write it into a texture; see `HeightMapShaders.fill`."""
        return self._shaders.fill(self._field, texture, layer)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        height_map = self._on_host(self._field.read())
        return height_map.astype(np.float32 if dtype is None else dtype, copy=False)


def halo_sources(
    topology: TexelTopology,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """The texel that each place of the charts with halo shows, and the corners that show none.

    Returns a table [C, n + 2, n + 2] and two tables of corners [k, 4]: the place of a corner, and
    the three places round it. The corners of the first table have the mean height of these three.
    The corners of the second lie in a fixed rim, where all four heights have a mean of 0.
    """
    sources = np.where(topology.halo >= 0, topology.halo, _NO_TEXEL)
    mirrored = np.zeros_like(topology.rim)
    if topology.fixed_rim:
        mirrored = topology.rim & (topology.halo >= 0)
    sources[mirrored] = _NO_TEXEL - 1 - topology.halo[mirrored]
    place = np.arange(sources.size).reshape(sources.shape)
    last = sources.shape[1] - 1
    means = []
    ends = []
    for corner, (r, c) in enumerate(((0, 0), (0, last), (last, last), (last, 0))):
        r_in = abs(r - 1)
        c_in = abs(c - 1)
        rows = np.stack(
            [place[:, r, c], place[:, r_in, c_in], place[:, r_in, c], place[:, r, c_in]], axis=1
        )
        means.append(rows[topology.halo[:, r, c] < 0])
        ends.append(rows[topology.valence[:, corner] == 0] if topology.fixed_rim else rows[:0])
    return (
        sources.astype(np.int32),
        np.concatenate(means).astype(np.int32),
        np.concatenate(ends).astype(np.int32),
    )


class HeightMap:
    """Turns a height field into a texture of gradient and height.

    The gradient at a texel is the gradient of the quadratic that best fits the heights of the eight
    neighbours, in the tangent plane. It is second-order accurate also where grid lines kink, at the
    borders and corners of charts, so that shading does not show them.

    Parameters
    ----------
    texels : TexelMesh
    limit : DisplacementLimit, optional
        Limit of the heights; gradients are those of the limited heights. By default no limit.
    """

    def __init__(self, texels: TexelMesh, limit: DisplacementLimit | None = None) -> None:
        self._topology = texels.topology
        self._limit = limit
        count = texels.positions[..., 0].size
        require_memory(
            SolverError,
            _TEXEL_BYTES * count,
            f"the height map of {count:,} texels",
            "take a lower resolution",
        )
        self._weights = _gradient_weights(texels)
        self._shaders: HeightMapShaders | None = None

    @classmethod
    def drawn(cls, atlas: Atlas, limit: bool = True) -> HeightMap:
        """Height map for drawing the surface of an atlas, by default with a `DisplacementLimit`."""
        return cls(atlas.texels, DisplacementLimit(atlas) if limit else None)

    @overload
    def __call__(self, height: NDArray[np.float32]) -> NDArray[np.float32]: ...

    @overload
    def __call__(self, height: DeviceField) -> DeviceHeightMap: ...

    def __call__(
        self, height: NDArray[np.float32] | DeviceField
    ) -> NDArray[np.float32] | DeviceHeightMap:
        """Height map of a height field.

        Parameters
        ----------
        height : float32 [C, n, n]
            [m]. Or a field on the GPU: then the height map is on the GPU as well, and is computed
            where it is drawn.

        Returns
        -------
        float32 [C, n + 2, n + 2, 4]
            Gradient of the height in the frame of the mesh (tangent to the surface, dimensionless),
            and the height [m]. For the halo see `fill_halo`. Beyond a fixed rim the heights are
            negative, so that drawn heights come to 0 at the rim.
        """
        if isinstance(height, DeviceField):
            if self._shaders is None:
                self._shaders = HeightMapShaders(
                    height.gl, self._topology, self._weights, self._limit
                )
            return DeviceHeightMap(self._shaders, height, self)
        around = np.zeros(self._topology.halo.shape, np.float32)
        around[:, 1:-1, 1:-1] = height if self._limit is None else self._limit(height)
        fill_halo(self._topology, around)
        height_map = np.zeros((*around.shape, 4), np.float32)
        _differentiate(self._weights, around, height_map)
        fill_around(self._topology, height_map)
        return height_map

    def rates(
        self, height: NDArray[np.float32], velocity: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Rate of the heights in the height map [m/s], [C, n + 2, n + 2].

        `height` [m] and `velocity` [m/s] are [C, n, n].
        """
        if self._limit is not None:
            velocity = self._limit.rate(height, velocity)
        rates = np.zeros((*self._topology.halo.shape, 4), np.float32)
        rates[:, 1:-1, 1:-1, 3] = velocity
        fill_around(self._topology, rates)
        return rates[..., 3]


def fill_around(topology: TexelTopology, height_map: NDArray[np.float32]) -> None:
    """Fill in the halo of a height map.

    Beyond a fixed rim, the halo has the texels' mirror images, with the heights' signs changed.
    """
    fill_halo(topology, height_map)
    if not topology.fixed_rim:
        return
    mirror = np.array([1, 1, 1, -1], np.float32)
    texels = height_map[:, 1:-1, 1:-1].reshape(-1, 4)
    height_map[topology.rim] = texels[topology.halo[topology.rim]] * mirror
    last = height_map.shape[1] - 1
    for corner, (r, c) in enumerate(((0, 0), (0, last), (last, last), (last, 0))):
        # the four places round a corner in the rim have a mean height of 0
        r_in = abs(r - 1)
        c_in = abs(c - 1)
        ends = topology.valence[:, corner] == 0
        heights = height_map[ends, ..., 3]
        sum_of_others = heights[:, r_in, c_in] + heights[:, r_in, c] + heights[:, r, c_in]
        height_map[ends, r, c, 3] = -sum_of_others


@kept_with
def _gradient_weights(texels: TexelMesh) -> NDArray[np.float32]:
    """Vectors g [1/m] with gradient = sum over the 8 neighbours of g (h_j - h_i), [C n^2, 8, 3]."""
    around = texels.halo_positions.copy()
    if not texels.topology.fixed_rim:
        # beyond a free rim the halo repeats heights: nothing is known there; the points of a fixed
        # rim are at height 0
        around[texels.topology.rim] = np.nan
    normals = texels.normals.reshape(-1, 3)
    weights = np.empty((len(normals), 8, 3), np.float32)
    for first in range(0, len(normals), _FITTED_TEXELS):
        block = np.arange(first, min(first + _FITTED_TEXELS, len(normals)))
        weights[block] = _fit(around, block, normals[block])
    return weights


def _fit(
    around: NDArray[np.float64], texels: NDArray[np.int64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The vectors of `_gradient_weights` at some texels [k], [k, 8, 3].

    `around` has all positions [m], with halo; `normal` [k, 3] the normals of the texels.
    """
    n = around.shape[1] - 2
    f, r, c = np.unravel_index(texels, (len(around), n, n))
    center = around[f, r + 1, c + 1]
    not_along_x = np.abs(normal[:, :1]) < _MAX_ALONG_X
    tangent = np.cross(normal, np.where(not_along_x, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    offset = np.stack(
        [around[f, r + 1 + down, c + 1 + right] - center for down, right in _AROUND], axis=1
    )
    exists = np.isfinite(offset[..., :1])
    offset = np.where(exists, offset, 0.0)
    scale = np.sqrt((offset**2).sum(axis=(1, 2)) / exists.sum(axis=(1, 2)))[:, None]
    scale = np.maximum(scale, np.finfo(np.float64).tiny)
    x = np.einsum("ijk,ik->ij", offset, tangent) / scale
    y = np.einsum("ijk,ik->ij", offset, bitangent) / scale
    design = np.stack([x, y, x * x / 2, x * y, y * y / 2], axis=-1) * exists
    normal_matrix = np.einsum("ijk,ijl->ikl", design, design)
    normal_matrix += _REGULARISATION * np.diag([_FIRST_ORDER_SHARE, _FIRST_ORDER_SHARE, 1, 1, 1])
    fit = np.linalg.solve(normal_matrix, np.swapaxes(design, 1, 2))[:, :2] / scale[:, :, None]
    return fit[:, 0, :, None] * tangent[:, None, :] + fit[:, 1, :, None] * bitangent[:, None, :]


@kernel
def _differentiate(weights: Floats32, h: Floats32, height_map: Floats32) -> None:
    """Fill in gradient and height of the texels, but not of the halo.

    `h` is a field with halo [C, n + 2, n + 2], and `height_map` [C, n + 2, n + 2, 4].
    """
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        f = i // n
        r = i % n + 1
        for c in range(1, n + 1):
            g = weights[i * n + c - 1]
            height = h[f, r, c]
            gx = gy = gz = np.float32(0)
            for k in range(8):
                step = h[f, r + _AROUND[k][0], c + _AROUND[k][1]] - height
                gx += g[k, 0] * step
                gy += g[k, 1] * step
                gz += g[k, 2] * step
            height_map[f, r, c, 0] = gx
            height_map[f, r, c, 1] = gy
            height_map[f, r, c, 2] = gz
            height_map[f, r, c, 3] = height
