"""The atlas: six faces of texels, each knowing the surface point it stands for."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.errors import AtlasError
from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.texels.cube_map.areas import texel_areas
from ripple_sim.solver.texels.cube_map.convention import face_coordinates, padded_indices
from ripple_sim.solver.texels.cube_map.nearest import sphere_directions, texels_at
from ripple_sim.solver.texels.cube_map.texture_coordinates import TextureCoordinates, texture_coordinates

from .quality import atlas_quality

# [m]. Squares of what is farther away overflow on the way to the nearest surface point.
_FARTHEST = 1e100


@dataclasses.dataclass(frozen=True, eq=False)
class Atlas:
    """Cube-map atlas of a closed genus-0 surface.

    Make one with `build_atlas`, `sphere_atlas` or `load_atlas`.

    Attributes
    ----------
    mesh : Mesh
        The surface.
    sphere : float64 [vertex_count, 3]
        Sphere map: one unit vector a vertex.
    positions, normals : float64 [6, N, N, 3]
        Surface point [m] and outward unit normal of every texel.
    triangles : int64 [6, N, N]
        Triangle of the mesh in which the texel lies.
    barycentrics : float64 [6, N, N, 3]
        Where in that triangle.
    timings : dict
        Seconds per stage of the construction.
    """

    mesh: Mesh
    sphere: NDArray[np.float64]
    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    timings: dict[str, float] = dataclasses.field(default_factory=dict)

    @property
    def resolution(self) -> int:
        """Texels along a face's edge, N."""
        return self.positions.shape[1]

    @functools.cached_property
    def areas(self) -> NDArray[np.float64]:
        """Area of the surface that belongs to each texel [m^2], shape [6, N, N]; the mass of its waves sits there."""
        return texel_areas(self.mesh, self.sphere, self.positions, self.triangles, self.barycentrics)

    @functools.cached_property
    def padded_positions(self) -> NDArray[np.float64]:
        """Positions [m] with the ring of neighbours, shape [6, N + 2, N + 2, 3]; NaN at the ring's corners."""
        index = padded_indices(self.resolution)
        padded = self.positions.reshape(-1, 3)[index]
        padded[index < 0] = np.nan
        return padded

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Closest surface points [m] and their directions on the unit sphere, each of shape [k, 3].

        Raises
        ------
        AtlasError
            If the points are not finite or not of shape [k, 3] or [3].
        """
        points = check_points(points)
        _, triangle, closest = self._tree.squared_distance(self.mesh.V, self.mesh.F, points)
        return closest, sphere_directions(self.mesh.V, self.mesh.F, self.sphere, triangle, closest)

    def locate(self, points: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Face, row and column of the surface points nearest to the given points [m].

        Row and column are in texel units, 0.0 at the centre of the first texel. Each result has shape [k].
        """
        _, directions = self.project(points)
        return face_coordinates(directions, self.resolution)

    def nearest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Closest surface points [m], [k, 3], and the flat index of the texel nearest to each in the atlas, [k]."""
        closest, directions = self.project(points)
        return closest, texels_at(directions, self.resolution)

    def nearest_texel(self, points: ArrayLike) -> NDArray[np.int64]:
        """Flat index (face N + row) N + column of the texel nearest in the atlas to each point, shape [k]."""
        return self.nearest(points)[1]

    def texture_coordinates(self) -> TextureCoordinates:
        """Face and place in the atlas at every corner of every triangle, those cut that cross an edge of the cube.

        The object's own texture coordinates, `mesh.uv` and `mesh.corner_uv`, stay as they are.
        """
        return texture_coordinates(self)

    def quality(self) -> dict[str, float]:
        """Figures of merit of the atlas.

        Returns
        -------
        dict
            `flipped` triangles, `solid_angle` [sr] (4 pi for a bijection), area-weighted stretch quantiles `q001`,
            `q01`, `q50`, `q99`, `q999`, `starved` share of the area whose texels are over 4 times too wide, `edge_min`
            and `edge_max` [m], `coverage` (texel area over mesh area: 1 but for limbs that fall between the texels),
            `spanned` (area of the mesh of texel centres over mesh area: it cuts creases short too).
        """
        return atlas_quality(self)

    def save(self, path: str | Path) -> None:
        """Write the atlas to one file, which `load_atlas` reads. The file appears whole or not at all."""
        from .atlas_file import save_atlas

        save_atlas(self, path)

    @functools.cached_property
    def _tree(self) -> Any:
        tree = igl.AABB()
        tree.init(self.mesh.V, self.mesh.F)
        return tree


def check_points(points: ArrayLike) -> NDArray[np.float64]:
    """Points as float64 [k, 3], or `AtlasError`."""
    array = np.asarray(points, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3 or array.ndim > 2:
        raise AtlasError(f"points have shape {array.shape}; valid is [3] or [k, 3], in metres")
    if not (np.abs(array) < _FARTHEST).all():
        raise AtlasError(f"points hold NaN or numbers beyond {_FARTHEST:g}; valid are finite coordinates in metres")
    return np.ascontiguousarray(array.reshape(-1, 3))
