"""The passes of one frame in their order: shadow maps, floor map, reflection, G-buffer, shading, transparent layers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import moderngl

from ripple_sim.render.passes.deferred import DeferredShading
from ripple_sim.render.passes.floor import Floor
from ripple_sim.render.passes.floor_occlusion import FloorOcclusion
from ripple_sim.render.passes.mirror import Mirror
from ripple_sim.render.passes.screen_bounds import boxes_of
from ripple_sim.render.passes.shadow import ShadowMaps
from ripple_sim.render.passes.surface_buffers import SurfaceBuffers, SurfaceImage
from ripple_sim.render.passes.transmission import TransmissionMaps

from .bounds import enclosing, within
from .camera import Pose
from .frame_format import FrameFormat
from .frame_uniforms import FrameUniforms
from .height_maps import AnyHeightMap
from .resources import Resources
from .scene import DrawnScene
from .scene_light import SceneLight

_TRANSMISSION_TEXEL = 4  # of the transmission maps, in texels of the shadow maps
_SHADOW_REACH = 2.5  # casters further than that from the focus, in camera distances, cast no shadow


class FramePasses:
    """Draws frames of a scene on the GPU.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
    scene : DrawnScene
    floor : Floor, optional
    light : SceneLight
    """

    def __init__(
        self,
        resources: Resources,
        frame_format: FrameFormat,
        scene: DrawnScene,
        floor: Floor | None,
        light: SceneLight,
    ) -> None:
        self._resources, self._gl, self._format = resources, resources.gl, frame_format
        self._scene, self._floor, self._light = scene, floor, light
        self._frame = FrameUniforms(resources)
        self._shadows = ShadowMaps(resources, light.shadows, frame_format.size[1])
        self._transmission = None
        if scene.transparent:
            size = self._shadows.size // _TRANSMISSION_TEXEL
            self._transmission = TransmissionMaps(resources, light.shadows, size)
        options = {**light.options, "TRANSMISSION": int(scene.transparent)}
        self._occlusion = FloorOcclusion(resources, options, floor)
        self._shading = DeferredShading(resources, frame_format, floor, options)
        self._buffers: SurfaceBuffers | None = None
        self._mirror = None
        if floor is not None and floor.reflects and not frame_format.alpha:
            self._mirror = Mirror(resources, frame_format, floor, options)

    def draw(
        self, data: Any, height_maps: Mapping[int, AnyHeightMap], pose: Pose, exposure: int
    ) -> moderngl.Framebuffer:
        """Draw a frame and leave it on the GPU; see `Renderer.draw`."""
        scene, shading = self._scene, self._shading
        with self._gl as ctx:
            scene.update(ctx, data, height_maps, pose)
            shading.clear(ctx)  # which a software driver does during what follows
            self._update(data, pose, exposure)
            self._draw_maps(ctx)
            shading.begin(ctx)
            scene.draw()
            balls = scene.balls(data)
            boxes = boxes_of(balls, pose, self._format.size)
            if self._gl.software:  # which would draw all this in the next call, holding the interpreter's lock
                self._gl.wait()
            self._occlusion.average()
            if self._mirror is not None:
                self._mirror.draw(ctx, self._frame, pose, balls, scene.draw, self._bind)
            self._bind()
            shading.shade(ctx, boxes)
            for layer in scene.layers(data, pose):
                shading.layers.add(ctx, layer.number, layer.draw, boxes_of(layer.balls, pose, self._format.size))
        return shading.frame

    def surfaces(
        self, data: Any, height_maps: Mapping[int, AnyHeightMap], pose: Pose, size: tuple[int, int]
    ) -> SurfaceImage:
        """Draw what each pixel shows, without light; see `Renderer.surfaces`."""
        scene = self._scene
        with self._gl as ctx:
            if self._buffers is None or self._buffers.size != size:
                floor_geom = -1 if self._floor is None else self._floor.geom
                self._buffers = SurfaceBuffers(self._resources, size, floor_geom)
            scene.update(ctx, data, height_maps, pose)
            self._update(data, pose, 0)
            scene.bind()

            def draw() -> None:
                scene.draw()
                for layer in scene.layers(data, pose):
                    layer.draw()

            return self._buffers.draw(ctx, draw)

    def _update(self, data: Any, pose: Pose, exposure: int) -> None:
        """Bring the frame's uniforms up to date."""
        frame, floor = self._frame, self._floor
        frame.set_camera(pose, self._format.aspect)
        casters = within(self._scene.casters(data), pose.focus, _SHADOW_REACH * pose.distance)
        centre, radius = enclosing(casters) if len(casters.radii) else (pose.focus, pose.distance)
        if floor is not None:
            floor.place(frame, data, centre, radius)
        lights = self._light.set(frame, data, pose, floor)
        casting = self._shadows.fit(frame, lights, centre, radius)
        if floor is not None and len(casters.radii):
            floor.shade(frame, casting, casters)
        frame.set_vector("counts", [0, len(lights), exposure], len(casting))
        frame.bind()

    def _draw_maps(self, ctx: moderngl.Context) -> None:
        """Draw what shading looks up. A software driver stops for each texture that it is still drawing to."""
        scene, shadows = self._scene, self._shadows
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<="
        shadows.draw(scene.draw_shadow)
        self._occlusion.look_up(ctx, scene.draw_occluders)
        shadows.find_blockers(ctx)
        if self._transmission is not None:
            self._transmission.draw(shadows.views, scene.draw_transmission)
            self._transmission.bind()
        self._occlusion.shade(ctx, shadows)

    def _bind(self) -> None:
        """Bind what shading needs."""
        self._scene.bind()
        self._shadows.bind()
        if self._transmission is not None:
            self._transmission.bind()
        self._occlusion.bind()
        if self._floor is not None:
            self._floor.bind()
        self._light.bind()
        if self._mirror is not None:
            self._mirror.bind()
