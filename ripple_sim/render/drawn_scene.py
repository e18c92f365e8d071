"""Everything that a frame shows on the GPU, and how it is drawn in each pass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId
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
from .surface_mesh import ClearTexels, SurfaceMesh

Drawable: TypeAlias = SurfaceMesh | ClearTexels | Instances


class DrawnScene:
    """Everything that is rasterised: targets as rippling surfaces, other geoms, and sites.

    Parameters
    ----------
    targets : mapping
        Target to the surface that is drawn instead of the target.
    size : (width, height)
        Size of the frame [pixels].

    Attributes
    ----------
    targets : list of SurfaceMesh
    opaque, transparent : list of SurfaceMesh, ClearTexels and Instances
        Each can draw itself into the G-buffer, and into the maps of the lights and of the floor.
    """

    def __init__(
        self, assets: Assets, targets: Mapping[TargetId, Surface], size: tuple[int, int]
    ) -> None:
        self._assets = assets
        self._model = assets.model
        self._height = size[1]
        sorted_targets = sorted(targets.items())
        pages = [surface.charts.page for _, surface in sorted_targets]
        self.height_maps = HeightMapTextures(assets.resources, pages)
        self.targets = [
            SurfaceMesh(assets, geom, surface, self.height_maps, index, size)
            for index, (geom, surface) in enumerate(sorted_targets)
        ]
        self._occluders = Occluders(assets.resources, assets.model, np.zeros(0, dtype=np.int64))
        self._made: dict[tuple[Any, ...], Instances] = {}
        self.show([])

    def show(
        self,
        visuals: list[tuple[Visual, NamedShape]],
        paints: Mapping[TargetId, Visual] | None = None,
        hidden: Sequence[TargetId] = (),
    ) -> None:
        """Choose the objects that are drawn from now on.

        Parameters
        ----------
        visuals : list of (Visual, NamedShape)
            Everything except targets and the floor.
        paints : mapping, optional
            Target to the visual with its colour and material.
        hidden : sequence of TargetId
            Targets that are not drawn.
        """
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
        self._assets.objects.keep(sum(len(target.numbers) for target in self.targets))
        self._instances = instances_of(self._assets, visuals, self._made)
        surfaces = [target for target in self.targets if target.geom not in hidden]
        clear_texels = [target.clear_texels for target in surfaces]
        drawn: list[Drawable] = [*surfaces, *filter(None, clear_texels), *self._instances]
        self.opaque = [drawable for drawable in drawn if not drawable.transparent]
        self.transparent = [drawable for drawable in drawn if drawable.transparent]
        casters = [drawable for drawable in drawn if drawable.casts]
        self._casters = {
            CasterMap.DEPTH: [drawable for drawable in casters if drawable.blocks],
            CasterMap.ALBEDO: [drawable for drawable in drawn if drawable.occludes],
            CasterMap.TRANSMISSION: [drawable for drawable in casters if not drawable.blocks],
        }

    def target(self, geom: TargetId) -> SurfaceMesh:
        """The target of a geom; raises `RippleError` if the geom is no target."""
        for target in self.targets:
            if target.geom == geom:
                return target
        geoms = ", ".join(str(target.geom) for target in self.targets) or "none"
        raise RippleError(f"geom {geom} is no target; the targets' geoms are: {geoms}")

    def update(
        self,
        ctx: moderngl.Context,
        data: Any,
        height_maps: Mapping[TargetId, AnyHeightMap],
        pose: Pose,
        sharp: bool = False,
    ) -> None:
        """Bring everything on the GPU up to date; for `sharp` see `Instances.update`."""
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
        """Balls [k, 4] that contain everything that is drawn."""
        others = [ball_of(self._model, data, visual) for visual in (*self._others, *self._planes)]
        return np.concatenate(
            [self._occluders.balls(data), *others, *(target.bounds() for target in self.targets)]
        )

    def casters(self, data: Any, largest: float = 0.0) -> NDArray[np.float64]:
        """Balls [k, 4] that contain everything that may cast a shadow.

        Planes whose radius is greater than `largest` [m] are left out. The balls keep their size
        while a target turns, so that shadow maps stay as they are.
        """
        others = [ball_of(self._model, data, visual) for visual in self._others if visual.casts]
        balls_of_planes = [ball_of(self._model, data, visual) for visual in self._planes]
        others += [ball for ball in balls_of_planes if ball[0, 3] <= largest]
        return np.concatenate(
            [self._occluders.balls(data), *others, *(target.ball() for target in self.targets)]
        )

    def draw(self) -> None:
        """Draw everything opaque into the G-buffer."""
        for drawable in self.opaque:
            drawable.draw()

    def cast(self, seen: CasterMap, **uniforms: Any) -> None:
        """Draw the objects that belong into a map of a light or of the floor.

        A depth map contains opaque casters, an albedo map everything that occludes the sky, and a
        transmission map transparent casters. The uniforms are those of casters.glsl: `matrix`, 16
        numbers, column by column, and for a transmission map the `light`.
        """
        for drawable in self._casters[seen]:
            drawable.cast(seen, **uniforms)

    def layers(self, data: Any, pose: Pose) -> list[tuple[NDArray[np.float64], Drawable]]:
        """Balls about every transparent object, and the object; the furthest object comes first."""
        layers = [(drawable.bounds(data), drawable) for drawable in self.transparent]

        def distance(layer: tuple[NDArray[np.float64], Drawable]) -> float:
            balls, drawable = layer
            if drawable.is_plane:  # behind everything else, as in MuJoCo
                return float("inf")
            offset = balls[:, :3].mean(axis=0) - pose.eye
            if pose.orthographic:
                return float(-offset @ pose.rotation[:, 2])
            return float(np.linalg.norm(offset))

        return sorted(layers, key=lambda layer: -distance(layer))
