"""Everything of a model that is rasterised: its targets, the other geoms, and its sites.

The light of a scene: the lights and the skybox of the MJCF, or the studio.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import target_pose
from ripple_sim.render.passes.floor import Floor
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.surfaces.surface_mesh import SurfaceMesh
from ripple_sim.render.visuals.geoms import GeomVisuals
from ripple_sim.render.visuals.instances import Assets
from ripple_sim.render.visuals.lights import (
    Light,
    Lighting,
    count_casting_lights,
    count_lights,
    has_near_lights,
    is_lit,
    model_lighting,
    set_lighting,
    studio_lighting,
)
from ripple_sim.render.visuals.visual import ball_of
from ripple_sim.solver.errors import RippleError

from .camera import Balls, Pose, join
from .contract import Unit
from .resources import AnyHeightMap, FrameUniforms, HeightMapTextures


class Layer(NamedTuple):
    """A transparent object: its bounding balls, its number in the table of objects, and what draws it."""

    balls: Balls
    number: int
    draw: Callable[[], None]


class DrawnScene:
    """The targets of a model as rippled surfaces, and its visuals.

    Parameters
    ----------
    assets : Assets
    targets : mapping
        Geom id to the surface that is drawn in place of the geom.
    geoms : list of int
        The other geoms, without the floor.
    size : (width, height)
        Of the frame [pixels].
    """

    def __init__(self, assets: Assets, targets: Mapping[int, Surface], geoms: list[int], size: tuple[int, int]) -> None:
        self._assets, self._model, self._height = assets, assets.model, size[1]
        self._height_maps = HeightMapTextures(
            assets.resources, [surface.charts.page for _, surface in sorted(targets.items())]
        )
        self._targets = [
            SurfaceMesh(assets, geom, surface, self._height_maps, index, size)
            for index, (geom, surface) in enumerate(sorted(targets.items()))
        ]
        self._geoms = GeomVisuals(assets, geoms)

    def set_heatmap(self, geom: int, values: NDArray[np.float32], limit: float) -> None:
        """Replace the heatmap of a target; see `SurfaceMesh.set_heatmap`."""
        for target in self._targets:
            if target.geom == geom:
                return target.set_heatmap(values, limit)
        geoms = ", ".join(str(target.geom) for target in self._targets) or "none"
        raise RippleError(f"geom {geom} is no target; the targets' geoms are: {geoms}")

    def update(self, ctx: moderngl.Context, data: Any, height_maps: Mapping[int, AnyHeightMap], pose: Pose) -> None:
        """Bring everything on the GPU up to date."""
        for target in self._targets:
            target.ripple(ctx, height_maps.get(target.geom))
        self._geoms.occluders.bind(data, pose.focus)
        for target in self._targets:
            origin, rotation = target_pose(data, target.geom)
            target.update(ctx, rotation, origin, self._geoms.occluders)
        pixels = self._height / (2 * np.tan(np.radians(pose.fovy) / 2))
        self._geoms.update(data, pose.position, pixels)
        self._assets.objects.bind()

    def balls(self, data: Any) -> Balls:
        """Balls that contain everything."""
        targets = (target.balls() for target in self._targets)
        return join(self._geoms.balls(data), self._geoms.planes(data), *targets)

    def casters(self, data: Any) -> Balls:
        """Balls that contain everything that may cast a shadow.

        They do not change their size as a target turns, so that shadow maps stay as they are.
        """
        return join(self._geoms.balls(data), *(target.ball() for target in self._targets))

    @property
    def transparent(self) -> bool:
        """Whether anything is."""
        return bool(self._geoms.transparent) or any(target.transparent for target in self._targets)

    def draw(self) -> None:
        """Draw everything opaque into the G-buffer."""
        for target in self._targets:
            if not target.transparent:
                target.draw()
        self._geoms.draw()

    def draw_shadow(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth of everything opaque, which casts shadows, under a matrix of 16 numbers, column by column."""
        for target in self._targets:
            if not target.transparent:
                target.draw_depth(view_projection)
        self._geoms.draw_depth(view_projection)

    def draw_transmission(self, view_projection: tuple[float, ...], light: int) -> None:
        """Draw everything transparent into the transmission map of a light, likewise."""
        for target in self._targets:
            if target.transparent:
                target.draw_transmission(view_projection, light)
        self._geoms.draw_transmission(view_projection, light)

    def draw_occluders(self, view_projection: tuple[float, ...]) -> None:
        """Draw everything that occludes the sky in its linear colour, likewise."""
        for target in self._targets:
            target.draw_albedo(view_projection)
        self._geoms.draw_albedo(view_projection)

    def layers(self, data: Any, pose: Pose) -> list[Layer]:
        """Everything transparent, the furthest first."""

        def away(layer: Layer) -> float:
            return float(np.linalg.norm(layer.balls.centres.mean(axis=0) - pose.eye))

        return sorted(self._layers(data), key=lambda layer: -away(layer))

    def _layers(self, data: Any) -> Iterator[Layer]:
        for target in self._targets:
            if target.transparent:
                yield Layer(target.balls(), target.number, target.draw)
        for each in self._geoms.transparent:
            yield Layer(ball_of(self._model, data, each.visual), each.number, each.instances.draw)

    def bind(self) -> None:
        """Bind the height maps for shading."""
        self._height_maps.bind()


LIGHTING = ("auto", "model", "studio")


class SceneLight:
    """What lights a model.

    Parameters
    ----------
    assets : Assets
    lighting : str
        One of `LIGHTING`; "auto": the studio where the MJCF has no light.

    Attributes
    ----------
    shadows : int
        How many lights may cast shadows.

    Raises
    ------
    RippleError
        If the lighting is unknown.
    """

    def __init__(self, assets: Assets, lighting: str) -> None:
        if lighting not in LIGHTING:
            raise RippleError(f"lighting is {lighting!r}; valid are {', '.join(map(repr, LIGHTING))}")
        self._model = model = assets.model
        self._studio = lighting == "studio" or (lighting == "auto" and not is_lit(model))
        self.shadows = 1 if self._studio else count_casting_lights(model)
        self._sky = None if self._studio else assets.textures.skybox()

    @property
    def options(self) -> dict[str, int]:
        """Defines for the shaders; see `DeferredShading`."""
        return {
            "SKYBOX": int(self._sky is not None),
            "NEAR_LIGHTS": int(not self._studio and has_near_lights(self._model)),
            "LIGHTS": 1 if self._studio else count_lights(self._model),
            "SHADOWS": self.shadows,
        }

    def set(self, frame: FrameUniforms, data: Any, pose: Pose, floor: Floor | None) -> list[Light]:
        """Set the frame's light and background; return the lights."""
        lighting: Lighting = studio_lighting(pose) if self._studio else model_lighting(self._model, data, pose)
        mean: NDArray[np.float64] | None = None if self._sky is None else self._sky[1]
        set_lighting(frame, lighting, pose, None if floor is None else floor.albedo, mean)
        if floor is not None:
            frame.set_vector("floor_light", lighting.on(pose.focus, floor.normal))
        return lighting.lights

    def bind(self) -> None:
        """Bind the skybox."""
        if self._sky is not None:
            self._sky[0].use(Unit.SKYBOX)
