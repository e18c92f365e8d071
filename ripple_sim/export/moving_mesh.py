"""`MovingMesh`: the surface of a target as a mesh of constant triangles that follows the waves."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.surfaces.moving import MovingVertices
from ripple_sim.render.surfaces.spline import spline_samples, spline_weights
from ripple_sim.render.surfaces.surface import Charts
from ripple_sim.render.surfaces.tessellation import COORDINATES, DIRECTION, NORMAL, POSITION, UV
from ripple_sim.render.surfaces.vertices import tessellated
from ripple_sim.render.visuals.corners import normalized, smooth_normals, split_corners
from ripple_sim.solver import Atlas, HeightMap
from ripple_sim.solver.kernel import Floats32, Ints32, kernel
from ripple_sim.solver.waves.motion import MovedGradients

from .options import MOST_TRIANGLES


class Displaced(NamedTuple):
    """A displaced surface in the frame of its geom.

    Attributes
    ----------
    points : float32 [n, 3]
        [m].
    normals : float32 [n, 3]
        Unit vectors.
    velocities : float32 [n, 3]
        [m/s].
    height : float32 [n]
        [m].
    """

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    velocities: NDArray[np.float32]
    height: NDArray[np.float32]


class MovingMesh:
    """The surface of an atlas, displaced as the renderer displaces it.

    A point lies at its place on the mesh plus its height times the smooth normal there; heights are
    interpolated between the texels by the quadratic B-spline. Its normal is tipped against the
    gradient of the height, to first order in the height. Creases stay sharp: a vertex has a point
    for each of its normals.

    Parameters
    ----------
    atlas : Atlas
    tessellation : str
        One of `TESSELLATIONS`: the mesh's "own" triangles, or "refined" until no edge is longer
        than a mean texel, and round in outline.
    limit : bool
        Whether heights that are too large for the object are bent, see `DisplacementLimit`.
    triangles : int
        About how many triangles a refined mesh may have, unless the mesh's own are more.

    Attributes
    ----------
    F : int64 [m, 3]
        Triangles, counter-clockwise from outside.
    rest, directions : float32 [n, 3]
        Points without waves [m], and the unit vectors along which these move them.
    uv : float64 [m, 3, 2], optional
        Texture coordinates of the triangles' corners, v from the image's lower edge.
    """

    def __init__(
        self,
        atlas: Atlas,
        tessellation: str = "refined",
        limit: bool = True,
        triangles: int = MOST_TRIANGLES,
    ) -> None:
        mesh = atlas.mesh
        smooth = smooth_normals(atlas.mesh.V, atlas.mesh.F)
        if tessellation == "own":  # vertices are split at creases
            vertex, self.F, normals, _, _ = split_corners(mesh.V, mesh.F)
            self.uv = mesh.corner_uv
            points = mesh.V[vertex]
            directions = smooth[vertex]
            chart, row, column = (place[vertex] for place in atlas.locate(mesh.V))
        else:  # the renderer's triangles, of about the size of texels
            charts = Charts.of(atlas)
            length = float(np.sqrt(atlas.areas.mean()))
            F, attributes, same = tessellated(
                mesh,
                charts,
                smooth=smooth,
                max_length=length,
                max_faces=triangles,
                corner_uv=mesh.corner_uv,
            )
            # vertices that differ in their texture coordinates or charts alone become one
            _, first, point = np.unique(same, return_index=True, return_inverse=True)
            self.F = point.ravel()[F]
            self.uv = None if mesh.corner_uv is None else attributes[F][:, :, UV]
            vertices = attributes[first]
            points = vertices[:, POSITION]
            directions = vertices[:, DIRECTION]
            normals = vertices[:, NORMAL]
            chart, row, column = charts.map.chart_points(vertices[:, COORDINATES], atlas.resolution)
        self.rest = points.astype(np.float32)
        self.directions = normalized(directions).astype(np.float32)
        self._normals = normalized(normals).astype(np.float32)
        self._texels, self._offsets = spline_samples(chart, row, column, atlas.resolution)
        self._height_map = HeightMap.drawn(atlas, limit)
        self._atlas = atlas

    @functools.cached_property
    def vertices(self) -> MovingVertices:
        """The points as they ride on the mesh's own vertices."""
        return MovingVertices(
            self._atlas.mesh.V, self._atlas.mesh.F, self.rest, self.directions, self._normals
        )

    @functools.cached_property
    def _gradients(self) -> MovedGradients:
        return MovedGradients(self._atlas)

    def samples(self, points: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Where some points [k] take their heights; see `spline_samples`."""
        return self._texels[points], self._offsets[points]

    def shape(
        self,
        height: NDArray[np.float32],
        velocity: NDArray[np.float32],
        V: NDArray[np.float64] | None = None,
    ) -> Displaced:
        """The surface under waves of a height [m] and a velocity [m/s], float32 [C, n, n] both.

        `V` [vertex_count, 3] [m] are the vertices of its mesh, if they have moved. The velocities
        of the shape are those of the waves alone.
        """
        shape = Displaced(
            points=np.empty_like(self.rest),
            normals=np.empty_like(self.rest),
            velocities=np.empty_like(self.rest),
            height=np.empty(len(self.rest), np.float32),
        )
        height_map = self._height_map(height)
        rates = self._height_map.rates(height, velocity)
        points = self.rest
        directions = self.directions
        normals = self._normals
        if V is not None:
            points, directions, normals = self.vertices(V)
            height_map = self._gradients(height_map, V)
        texels = self._texels
        _displace(height_map, rates, points, directions, normals, texels, self._offsets, shape)
        return shape


@kernel
def _displace(
    height_map: Floats32,
    rates: Floats32,
    still: Floats32,
    directions: Floats32,
    upright: Floats32,
    texels: Ints32,
    offsets: Floats32,
    shape: Displaced,
) -> None:
    """Fill in a shape from a height map [C, n + 2, n + 2, 4] and its rates [C, n + 2, n + 2].

    The surface without waves has the points `still`, directions, and normals `upright`, all [n, 3].
    `texels` [n, 3] are the first of 3 x 3 (chart, row, column) on charts with halo, `offsets` [n,
    2] are from the middle one [texels].
    """
    points, normals, velocities, heights = shape
    for i in range(len(points)):
        chart, row, column = texels[i]
        down = spline_weights(offsets[i, 0])
        across = spline_weights(offsets[i, 1])
        gx = gy = gz = h = v = np.float32(0)
        for j in range(3):
            for k in range(3):
                weight = down[j] * across[k]
                texel = height_map[chart, row + j, column + k]
                gx += weight * texel[0]
                gy += weight * texel[1]
                gz += weight * texel[2]
                h += weight * texel[3]
                v += weight * rates[chart, row + j, column + k]
        heights[i] = h
        for k in range(3):
            points[i, k] = still[i, k] + h * directions[i, k]
            velocities[i, k] = v * directions[i, k]
        x = upright[i, 0] - gx
        y = upright[i, 1] - gy
        z = upright[i, 2] - gz
        scale = 1 / np.sqrt(x * x + y * y + z * z)
        normals[i, 0] = x * scale
        normals[i, 1] = y * scale
        normals[i, 2] = z * scale
