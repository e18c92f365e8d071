"""The height map where the heights are on the GPU: they go into the renderer's texture without leaving it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..backends.device_field import DeviceField
from ..errors import SolverError
from ..gl import GLContext
from ..texels.chart_page import ChartPage
from ..texels.topology import TexelTopology
from .displacement_limit import FREE, MOST, DisplacementLimit

_GROUP = 256
_SHADERS = "ripple_sim.solver"
_NONE = -1  # of the table of sources: no texel lies there; below: a texel's mirror image, -2 - its number


class HeightMapShaders:
    """What turns heights into height maps on the GPU, see `HeightMap`.

    Parameters
    ----------
    gl : GLContext
    topology : TexelTopology
    weights : float32 [C n^2, 8, 3]
        Of the gradient.
    limit : DisplacementLimit, optional
    """

    def __init__(
        self, gl: GLContext, topology: TexelTopology, weights: NDArray[np.float32], limit: DisplacementLimit | None
    ) -> None:
        self._gl, self._limit, self.shape = gl, limit, (*topology.halo.shape, 4)
        charts, n, _ = topology.shape
        sources, means, ends = _tables(topology)
        self._place_count, self._corner_counts = sources.size, (len(means), len(means) + len(ends))
        defines = {"GROUP": _GROUP, "N": n, "COLUMNS": ChartPage(charts, n).columns, "FREE": FREE, "MOST": MOST}
        with gl as ctx:
            self._heights, self._limited, self._map, self._corners = (
                gl.shared_compute_shader(_SHADERS, f"waves/shaders/{name}", **defines, **more)
                for name, more in (
                    ("halo_heights", {}),
                    ("halo_heights", {"LIMIT": 1}),
                    ("height_map", {}),
                    ("height_map_corners", {}),
                )
            )
            self._sources = ctx.buffer(sources.tobytes())
            self._corner_places = ctx.buffer(np.concatenate([means, ends]).tobytes() or bytes(16))
            self._weights = ctx.buffer(weights.tobytes())
            self._around = ctx.buffer(bytes(4 * sources.size))
            self._peak = ctx.buffer(bytes(4))
        self._radii: moderngl.Buffer | None = None

    def fill(self, field: DeviceField, texture: moderngl.TextureArray, layer: int) -> float:
        """Write the height map's page into a layer of a texture, RGBA32F; return the largest height drawn [m].

        Raises
        ------
        SolverError
            If a height is not finite.
        """
        highest = field.peak
        if not np.isfinite(highest):
            raise SolverError(
                "heights to be drawn are no longer finite; a source was too large for float32: make it smaller and "
                "`reset()` the waves"
            )
        limit = self._limit
        limited = limit is not None and limit.may_bend(highest)
        with self._gl as ctx:
            if limit is not None and limited:
                self._peak.write(bytes(4))
                self._radii = self._radii or ctx.buffer(limit.radius.tobytes())
            self._bind(self._around, self._peak, self._sources, field.buffer, self._radii)
            self._run(ctx, self._limited if limited else self._heights, self._place_count)
            texture.bind_to_image(0, read=True, write=True)
            self._bind(self._around, self._weights, self._sources)
            self._map["layer"] = layer
            self._run(ctx, self._map, self._place_count)
            self._bind(self._corner_places)
            self._corners["layer"], self._corners["means"], self._corners["count"] = layer, *self._corner_counts
            self._run(ctx, self._corners, self._corner_counts[1])
            return float(np.frombuffer(self._peak.read(), np.float32)[0]) if limited else highest

    def _bind(self, *buffers: moderngl.Buffer | None) -> None:
        for binding, buffer in enumerate(buffers):
            if buffer is not None:
                buffer.bind_to_storage_buffer(binding)

    def _run(self, ctx: moderngl.Context, shader: moderngl.ComputeShader, count: int) -> None:
        if count:
            shader.run(-(-count // _GROUP))
            ctx.memory_barrier()


class DeviceHeightMap:
    """The height map of a field on the GPU, not yet made; `numpy.asarray` gives it as `HeightMap` does.

    Attributes
    ----------
    gl : GLContext
    shape : (C, n + 2, n + 2, 4)
    """

    def __init__(self, shaders: HeightMapShaders, field: DeviceField, on_host: Callable[[NDArray], NDArray]) -> None:
        self._shaders, self._field, self._on_host = shaders, field, on_host
        self.gl, self.shape = field.gl, shaders.shape

    def fill(self, texture: moderngl.TextureArray, layer: int) -> float:
        """Write it into a texture; see `HeightMapShaders.fill`."""
        return self._shaders.fill(self._field, texture, layer)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        return self._on_host(self._field.read()).astype(np.float32 if dtype is None else dtype, copy=False)


def _tables(topology: TexelTopology) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """The texel that each place of the charts with halo shows, [C, n + 2, n + 2], and the corners that show none.

    A corner is a row of its place and the three about it: first of those with their mean, then of those in a fixed rim,
    where the four heights have a mean of 0.
    """
    sources = np.where(topology.halo >= 0, topology.halo, _NONE)
    mirrored = topology.rim & (topology.halo >= 0) if topology.fixed_rim else np.zeros_like(topology.rim)
    sources[mirrored] = _NONE - 1 - topology.halo[mirrored]
    place = np.arange(sources.size).reshape(sources.shape)
    last = sources.shape[1] - 1
    means, ends = [], []
    for corner, (r, c) in enumerate(((0, 0), (0, last), (last, last), (last, 0))):
        r_in, c_in = abs(r - 1), abs(c - 1)
        rows = np.stack([place[:, r, c], place[:, r_in, c_in], place[:, r_in, c], place[:, r, c_in]], axis=1)
        means.append(rows[topology.halo[:, r, c] < 0])
        ends.append(rows[topology.valence[:, corner] == 0] if topology.fixed_rim else rows[:0])
    return sources.astype(np.int32), np.concatenate(means).astype(np.int32), np.concatenate(ends).astype(np.int32)
