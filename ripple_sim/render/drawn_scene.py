"""Everything that a frame shows on the GPU, and how it is drawn in each pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import target_pose
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.visuals.geoms import Instances, instances_of
from ripple_sim.render.visuals.objects import Assets, Occluders
from ripple_sim.render.visuals.shapes import NamedShape
from ripple_sim.render.visuals.visual import Visual, ball_of, box_of
from ripple_sim.solver.errors import RippleError

from .contract import CasterMap
from .height_map_textures import AnyHeightMap, HeightMapTextures
from .pose import Pose
from .surface_mesh import SurfaceMesh


class DrawnScene:
    """Everything of a model that is rasterised: its targets as rippled surfaces, the other geoms, and its sites.

    Parameters
    ----------
    targets : mapping
        Geom id to the surface that is drawn in place of the geom.
    size : (width, height)
        Of the frame [pixels].

    Attributes
    ----------
    targets : list of SurfaceMesh
    opaque, transparent : list of SurfaceMesh and Instances
        Each can draw itself: into the G-buffer, or what a map of a light or of the floor has of it.
    """

    def __init__(
        self, assets: Assets, targets: Mapping[int, Surface], size: tuple[int, int]
    ) -> None:
        self._assets = assets
        self._model = assets.model
        self._height = size[1]
        ordered = sorted(targets.items())
        self.height_maps = HeightMapTextures(
            assets.resources, [surface.charts.page for _, surface in ordered]
        )
        self.targets = [
            SurfaceMesh(assets, *each, self.height_maps, index, size)
            for index, each in enumerate(ordered)
        ]
        self._occluders = Occluders(assets.resources, assets.model, np.zeros(0, dtype=np.int64))
        self._made: dict[tuple[Any, ...], Instances] = {}
        self.show([])

    def show(
        self,
        visuals: list[tuple[Visual, NamedShape]],
        paints: Mapping[int, Visual] | None = None,
        hidden: Sequence[int] = (),
    ) -> None:
        """Draw these from now on, without the floor, and all targets but the hidden ones, painted as they stand for."""
        of_geoms = [visual for visual, _ in visuals if visual.index >= 0 and not visual.site]
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        self._planes = [visual for visual in of_geoms if visual.kind == plane]
        self._others = [visual for visual, _ in visuals if visual.site or visual.index < 0]
        solids = [visual for visual in of_geoms if visual.kind != plane]
        boxes = np.array([np.concatenate(box_of(self._model, visual)) for visual in solids])
        self._occluders.hold(
            np.array([visual.index for visual in solids], dtype=np.int64), boxes.reshape(-1, 6)
        )
        for target in self.targets:
            if paints is not None and target.geom in paints:
                target.paint(paints[target.geom])
        self._assets.objects.keep(len(self.targets))
        self._instances = instances_of(self._assets, visuals, self._made)
        surfaces = [target for target in self.targets if target.geom not in hidden]
        drawn: list[SurfaceMesh | Instances] = [*surfaces, *self._instances]
        self.opaque = [each for each in drawn if not each.transparent]
        self.transparent = [each for each in drawn if each.transparent]
        self._casters = {
            CasterMap.DEPTH: [each for each in drawn if each.casts and each.blocks],
            CasterMap.ALBEDO: [each for each in drawn if each.occludes],
            CasterMap.TRANSMISSION: [each for each in drawn if each.casts and not each.blocks],
        }

    def target(self, geom: int) -> SurfaceMesh:
        """The target of a geom; raises `RippleError` if the geom is no target."""
        if (
            found := next((target for target in self.targets if target.geom == geom), None)
        ) is not None:
            return found
        geoms = ", ".join(str(target.geom) for target in self.targets) or "none"
        raise RippleError(f"geom {geom} is no target; the targets' geoms are: {geoms}")

    def update(
        self,
        ctx: moderngl.Context,
        data: Any,
        height_maps: Mapping[int, AnyHeightMap],
        pose: Pose,
        sharp: bool = False,
    ) -> None:
        """Bring everything on the GPU up to date; `sharp` is as for `Instances.update`."""
        for target in self.targets:
            target.ripple(ctx, height_maps.get(target.geom))
        self._occluders.bind(data, pose.focus)
        for target in self.targets:
            origin, rotation = target_pose(data, target.geom)
            target.update(rotation, origin, self._occluders)
        for instances in self._instances:
            instances.update(data, pose, self._height, self._occluders, sharp)
        self._assets.objects.bind()

    def balls(self, data: Any) -> NDArray[np.float64]:
        """Balls [k, 4] that contain everything."""
        others = [ball_of(self._model, data, visual) for visual in (*self._others, *self._planes)]
        return np.concatenate(
            [self._occluders.balls(data), *others, *(target.bounds() for target in self.targets)]
        )

    def casters(self, data: Any, largest: float = 0.0) -> NDArray[np.float64]:
        """Balls that contain everything that may cast a shadow, but for planes larger than that radius [m].

        They do not change their size as a target turns, so that shadow maps stay as they are.
        """
        others = [ball_of(self._model, data, visual) for visual in self._others if visual.casts]
        planes = [ball_of(self._model, data, visual) for visual in self._planes]
        others += [ball for ball in planes if ball[0, 3] <= largest]
        return np.concatenate(
            [self._occluders.balls(data), *others, *(target.ball() for target in self.targets)]
        )

    def draw(self) -> None:
        """Draw everything opaque into the G-buffer."""
        for each in self.opaque:
            each.draw()

    def cast(self, seen: CasterMap, **uniforms: Any) -> None:
        """Draw into a map what belongs there: of opaque casters, of all that occludes the sky, of transparent casters.

        Uniforms are those of casters.glsl: `matrix`, 16 numbers, column by column, and the `light`
        of a transmission.
        """
        for each in self._casters[seen]:
            each.cast(seen, **uniforms)

    def layers(
        self, data: Any, pose: Pose
    ) -> list[tuple[NDArray[np.float64], SurfaceMesh | Instances]]:
        """Everything transparent with the balls about it, the furthest first."""
        layers = [(each.bounds(data), each) for each in self.transparent]

        def distance(layer: tuple[NDArray[np.float64], SurfaceMesh | Instances]) -> float:
            if layer[1].is_plane:  # behind all else, as in MuJoCo
                return float("inf")
            offset = layer[0][:, :3].mean(axis=0) - pose.eye
            return float(
                -offset @ pose.rotation[:, 2] if pose.orthographic else np.linalg.norm(offset)
            )

        return sorted(layers, key=lambda layer: -distance(layer))
