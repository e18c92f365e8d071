"""Passes: what a frame's pixels show, as numbers: distances, normals, geoms, positions, heights and motion."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose
from ripple_sim.render.passes.surface_buffers import SurfaceImage
from ripple_sim.render.surfaces.adaptive import spline_heights, spline_samples
from ripple_sim.render.surfaces.moving import MovingVertices
from ripple_sim.solver.texels.texel_atlas import ChartPage


@dataclasses.dataclass(frozen=True, eq=False)
class Sighting:
    """What the camera sees at a time.

    Attributes
    ----------
    image : SurfaceImage
    pose : Pose
        Of the camera.
    positions, rotations : float64 [geom_count, 3], [geom_count, 3, 3]
        Of the geoms [m].
    height_maps : mapping
        By geom id, float32 [C, n + 2, n + 2, 4].
    meshes : mapping
        Likewise, vertices [n, 3] [m] and triangles [m, 3] of the targets, in their frames.
    """

    image: SurfaceImage
    pose: Pose
    positions: NDArray[np.float64]
    rotations: NDArray[np.float64]
    height_maps: Mapping[int, NDArray[np.float32]]
    meshes: Mapping[int, tuple[NDArray, NDArray]]

    @property
    def positions_seen(self) -> NDArray[np.float64]:
        """Points in the world [m], [height, width, 3]; 0 where nothing is."""
        height, width = self.image.depth.shape
        half = np.tan(np.radians(self.pose.fovy) / 2)
        x = half * (2 * (np.arange(width) + 0.5) - width) / height
        y = half * (1 - 2 * (np.arange(height) + 0.5) / height)
        way = np.stack([*np.meshgrid(x, y), np.full((height, width), -1.0)], axis=-1) @ self.pose.rotation.T
        depth = self.image.depth[..., None].astype(np.float64)
        return np.where(depth > 0, self.pose.position + depth * way, 0.0)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where points [..., 3] of the world [m] are in the frame: columns and rows, 0.5 in the first one's middle."""
        height, width = self.image.depth.shape
        local = (points - self.pose.position) @ self.pose.rotation
        scale = height / (2 * np.tan(np.radians(self.pose.fovy) / 2))
        away = np.maximum(-local[..., 2], 1e-12)[..., None]
        return np.array([width, height]) / 2 + scale * local[..., :2] * [1, -1] / away

    def flow_to(self, later: Sighting) -> NDArray[np.float32]:
        """How far each pixel's surface point moves in the frame [pixels], to the right and down, [height, width, 2].

        The point rides on its geom, on a target that moves with its mesh, and on the waves, along the smooth normal. 0
        where nothing is.
        """
        image, seen = self.image, self.positions_seen
        flow = np.zeros((*image.depth.shape, 2), np.float32)
        for geom in np.unique(image.geom[image.geom >= 0]):
            mask = image.geom == geom
            rotation, points = self.rotations[geom], seen[mask]
            local = (points - self.positions[geom]) @ rotation
            if geom in later.height_maps and (image.target[mask] >= 0).all():
                height_map = later.height_maps[geom]
                page = ChartPage(len(height_map), height_map.shape[1] - 2)
                heights = spline_heights(height_map, *spline_samples(page, image.place[mask].astype(np.float64)))
                direction = image.smooth_normal[mask] @ rotation
                still = local - image.height[mask, None] * direction
                still, direction = _taken_along(self.meshes[geom], later.meshes[geom], still, direction)
                local = still + heights[:, None] * direction
            moved = local @ later.rotations[geom].T + later.positions[geom]
            flow[mask] = later.pixels(moved) - self.pixels(points)
        return flow


def _taken_along(
    mesh: tuple[NDArray, NDArray], later: tuple[NDArray, NDArray], points: NDArray, directions: NDArray
) -> tuple[NDArray, NDArray]:
    """Points of a mesh and the directions in which waves move them, both [k, 3], once the mesh has moved on."""
    if np.array_equal(mesh[0], later[0]):
        return points, directions
    points, directions, _ = MovingVertices(*mesh, points, directions, directions)(later[0])
    return points.astype(np.float64), directions.astype(np.float64)


def passes_of(sighting: Sighting, later: Sighting | None, names: tuple[str, ...]) -> dict[str, NDArray]:
    """The passes of a frame, by name; `later` is the next frame's sighting, without which nothing flows."""
    image = sighting.image
    makers = {
        "depth": lambda: np.where(image.depth > 0, image.depth, np.float32(np.inf)),
        "normal": lambda: image.normal,
        "segmentation": lambda: (image.geom + 1).astype(np.uint32),
        "flow": lambda: np.zeros((*image.depth.shape, 2), np.float32) if later is None else sighting.flow_to(later),
        "position": lambda: sighting.positions_seen.astype(np.float32),
        "height": lambda: image.height,
    }
    return {name: np.ascontiguousarray(makers[name]()) for name in names}
