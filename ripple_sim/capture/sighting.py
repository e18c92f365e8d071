"""`Sighting`: what the camera sees at a time, and `passes_of`: the passes of a frame.

Passes say in numbers what the pixels of a frame show: distances, normals, geoms, positions, heights
and motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId
from ripple_sim.render.pose import Pose
from ripple_sim.render.surface_image import SurfaceImage
from ripple_sim.render.surfaces.moving import MovingVertices
from ripple_sim.render.surfaces.spline import spline_heights, spline_samples
from ripple_sim.solver.texels.chart_page import ChartPage


@dataclasses.dataclass(frozen=True, eq=False)
class Sighting:
    """The scene from the camera at one time.

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
    height_maps: Mapping[TargetId, NDArray[np.float32]]
    meshes: Mapping[TargetId, tuple[NDArray, NDArray]]

    @property
    def positions_seen(self) -> NDArray[np.float64]:
        """Points in the world [m], [height, width, 3]; 0 where nothing is."""
        depth = self.image.depth
        return np.where(depth[..., None] > 0, self.pose.points(depth), 0.0)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Columns and rows [..., 2] of the frame where points [..., 3] of the world [m] are seen.

        The middle of the first pixel is at 0.5.
        """
        height, width = self.image.depth.shape
        return self.pose.pixels(points, (width, height))[0]

    def flow_to(self, later: Sighting) -> NDArray[np.float32]:
        """How far the surface point of each pixel moves in the frame [pixels], [height, width, 2].

        Positive numbers are to the right and down; 0 is where nothing is. The point rides on its
        geom, on the mesh of a target that moves, and on the waves, along the smooth normal.
        """
        image = self.image
        positions_seen = self.positions_seen
        flow = np.zeros((*image.depth.shape, 2), np.float32)
        for geom in np.unique(image.geom[image.geom >= 0]):
            mask = image.geom == geom
            points = positions_seen[mask]
            # in the geom's frame [m]
            local = (points - self.positions[geom]) @ self.rotations[geom]
            if geom in later.height_maps and (image.target[mask] >= 0).all():
                local = self._on_later_waves(geom, mask, local, later)
            points_later = local @ later.rotations[geom].T + later.positions[geom]
            flow[mask] = later.pixels(points_later) - self.pixels(points)
        return flow

    def _on_later_waves(
        self, geom: TargetId, mask: NDArray[np.bool_], local: NDArray[np.float64], later: Sighting
    ) -> NDArray[np.float64]:
        """Points of a target, `local` [k, 3] in its frame [m], on mesh and waves of `later`.

        `mask` [height, width] says in which pixels they are seen.
        """
        image = self.image
        height_map = later.height_maps[geom]
        page = ChartPage(len(height_map), height_map.shape[1] - 2)
        chart, row, column = page.locate(image.place[mask].astype(np.float64))
        texels, offsets = spline_samples(chart, row, column, page.resolution)
        heights_later = spline_heights(height_map, texels, offsets)  # [m]
        direction = image.smooth_normal[mask] @ self.rotations[geom]
        still = local - image.height[mask, None] * direction
        V, F = self.meshes[geom]
        V_later, _ = later.meshes[geom]
        if not np.array_equal(V, V_later):  # the mesh takes points and directions along
            moved, turned, _ = MovingVertices(V, F, still, direction, direction)(V_later)
            still = moved.astype(np.float64)
            direction = turned.astype(np.float64)
        return still + heights_later[:, None] * direction


def passes_of(
    sighting: Sighting, later: Sighting | None, names: tuple[str, ...]
) -> dict[str, NDArray]:
    """The passes of a frame, by name.

    `later` is the sighting of the next frame; without it the flow is 0.
    """
    image = sighting.image

    def flow() -> NDArray[np.float32]:
        if later is None:
            return np.zeros((*image.depth.shape, 2), np.float32)
        return sighting.flow_to(later)

    makers = {
        "depth": lambda: np.where(image.depth > 0, image.depth, np.float32(np.inf)),
        "normal": lambda: image.normal,
        "segmentation": lambda: (image.geom + 1).astype(np.uint32),
        "flow": flow,
        "position": lambda: sighting.positions_seen.astype(np.float32),
        "height": lambda: image.height,
    }
    return {name: np.ascontiguousarray(makers[name]()) for name in names}
