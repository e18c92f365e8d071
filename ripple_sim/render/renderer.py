"""The renderer: a MuJoCo model and its rippled targets, drawn headless into frames.

The passes of one frame in their order: shadow maps, floor map, reflection, G-buffer, shading, transparent layers.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.soft import target_pose
from ripple_sim.render.passes.deferred import DeferredShading, Mirror, TransparentLayers
from ripple_sim.render.passes.floor import Floor, FloorOcclusion, find_floor
from ripple_sim.render.passes.shadow import ShadowMaps, TransmissionMaps
from ripple_sim.render.passes.surface_buffers import SurfaceBuffers, SurfaceImage
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.surfaces.surface_mesh import SurfaceMesh
from ripple_sim.render.visuals.geoms import Instances, instances_of, visuals_of, warn_of_unsupported
from ripple_sim.render.visuals.lights import SceneLight
from ripple_sim.render.visuals.objects import Assets, Occluders
from ripple_sim.render.visuals.visual import ball_of, visible_geoms
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.files import require_memory
from ripple_sim.solver.gl import GLContext

from .camera import Pose, Viewpoint, boxes_of, enclosing, within
from .resources import AnyHeightMap, FrameUniforms, HeightMapTextures, Resources
from .targets import FrameFormat, Readback

_TRANSMISSION_TEXEL = 4  # of the transmission maps, in texels of the shadow maps
_SHADOW_REACH = 2.5  # casters further than that from the focus, in camera distances, cast no shadow


class DrawnScene:
    """Everything of a model that is rasterised: its targets as rippled surfaces, the other geoms, and its sites.

    Parameters
    ----------
    assets : Assets
    targets : mapping
        Geom id to the surface that is drawn in place of the geom.
    geoms : list of int
        The other geoms, without the floor.
    size : (width, height)
        Of the frame [pixels].

    Attributes
    ----------
    targets : list of SurfaceMesh
    opaque, transparent : list of SurfaceMesh and Instances
        Each can draw itself: into the G-buffer, or its depth, colour or transmission under a matrix.
    """

    def __init__(self, assets: Assets, targets: Mapping[int, Surface], geoms: list[int], size: tuple[int, int]) -> None:
        self._assets, self._model, self._height = assets, assets.model, size[1]
        ordered = sorted(targets.items())
        self.height_maps = HeightMapTextures(assets.resources, [surface.charts.page for _, surface in ordered])
        self.targets = [
            SurfaceMesh(assets, geom, surface, self.height_maps, index, size)
            for index, (geom, surface) in enumerate(ordered)
        ]
        visuals = visuals_of(assets.model, geoms)
        plane = mujoco.mjtGeom.mjGEOM_PLANE
        solid = [visual.index for visual in visuals if not visual.site and visual.kind != plane]
        self._planes = [visual for visual in visuals if not visual.site and visual.kind == plane]
        self._sites = [visual for visual in visuals if visual.site]
        self._occluders = Occluders(assets.resources, assets.model, np.array(solid, dtype=np.int64))
        self._instances = instances_of(assets, visuals)
        drawn: list[SurfaceMesh | Instances] = [*self.targets, *self._instances]
        self.opaque = [each for each in drawn if not each.transparent]
        self.transparent = [each for each in drawn if each.transparent]
        self._occluding = [each for each in drawn if each.occludes]

    def target(self, geom: int) -> SurfaceMesh:
        """The target of a geom.

        Raises
        ------
        RippleError
            If the geom is no target.
        """
        for target in self.targets:
            if target.geom == geom:
                return target
        geoms = ", ".join(str(target.geom) for target in self.targets) or "none"
        raise RippleError(f"geom {geom} is no target; the targets' geoms are: {geoms}")

    def update(self, ctx: moderngl.Context, data: Any, height_maps: Mapping[int, AnyHeightMap], pose: Pose) -> None:
        """Bring everything on the GPU up to date."""
        for target in self.targets:
            target.ripple(ctx, height_maps.get(target.geom))
        self._occluders.bind(data, pose.focus)
        for target in self.targets:
            origin, rotation = target_pose(data, target.geom)
            target.update(ctx, rotation, origin, self._occluders)
        pixels = self._height / (2 * np.tan(np.radians(pose.fovy) / 2))
        for instances in self._instances:
            instances.update(data, pose.position, pixels, self._occluders)
        self._assets.objects.bind()

    def balls(self, data: Any) -> NDArray[np.float64]:
        """Balls [k, 4] that contain everything."""
        planes = [ball_of(self._model, data, visual) for visual in self._planes]
        return np.concatenate([*self._geom_balls(data), *planes, *(target.bounds() for target in self.targets)])

    def casters(self, data: Any) -> NDArray[np.float64]:
        """Balls that contain everything that may cast a shadow.

        They do not change their size as a target turns, so that shadow maps stay as they are.
        """
        return np.concatenate([*self._geom_balls(data), *(target.ball() for target in self.targets)])

    def _geom_balls(self, data: Any) -> list[NDArray[np.float64]]:
        """Of everything but the targets that may cast a shadow."""
        return [self._occluders.balls(data), *(ball_of(self._model, data, site) for site in self._sites)]

    def draw(self) -> None:
        """Draw everything opaque into the G-buffer."""
        for each in self.opaque:
            each.draw()

    def draw_shadow(self, view_projection: tuple[float, ...]) -> None:
        """Draw the depth of everything opaque, which casts shadows, under a matrix of 16 numbers, column by column."""
        for each in self.opaque:
            each.draw_depth(view_projection)

    def draw_transmission(self, view_projection: tuple[float, ...], light: int) -> None:
        """Draw everything transparent into the transmission map of a light, likewise."""
        for each in self.transparent:
            each.draw_transmission(view_projection, light)

    def draw_occluders(self, view_projection: tuple[float, ...]) -> None:
        """Draw everything that occludes the sky in its linear colour, likewise."""
        for each in self._occluding:
            each.draw_albedo(view_projection)

    def layers(self, data: Any, pose: Pose) -> list[tuple[NDArray[np.float64], SurfaceMesh | Instances]]:
        """Everything transparent with the balls about it, the furthest first."""
        layers = [(each.bounds(data), each) for each in self.transparent]
        return sorted(layers, key=lambda layer: -np.linalg.norm(layer[0][:, :3].mean(axis=0) - pose.eye))


# Memory for a pixel and for each of its samples, at least [bytes].
_PIXEL, _SAMPLE = 8, 20


class Renderer:
    """Draws a MuJoCo model and its rippled targets into frames, headless.

    Parameters
    ----------
    gl : GLContext
    model : mujoco.MjModel
    targets : mapping
        Geom id to the surface that is drawn in place of the geom.
    size : (width, height)
        Of a frame [pixels].
    samples : int
        Samples a pixel for smooth edges; at most as many as the driver has. 0 or 1: none.
    lighting : str
        "model": the lights and the skybox of the MJCF; "studio": a photo studio in their place; "auto": the studio
        where the MJCF has no light.
    alpha : bool
        Frames have an alpha channel: the background is transparent, and only the shadows are left of the floor.
    linear : bool
        Frames are linear light without tone mapping, in half floats.

    Raises
    ------
    RippleError
        If the driver cannot make frames of this size, or memory holds none, a look or the lighting is unknown, or
        linear frames are to show a heatmap or a grid, whose colours are the screen's.
    """

    def __init__(
        self,
        gl: GLContext,
        model: Any,
        targets: Mapping[int, Surface],
        *,
        size: tuple[int, int],
        samples: int = 4,
        lighting: str = "auto",
        alpha: bool = False,
        linear: bool = False,
    ) -> None:
        if linear and any(surface.heatmap_colors is not None or surface.grid for surface in targets.values()):
            raise RippleError(
                "heatmaps and grids have the screen's colours, which linear light lacks: take linear=False"
            )
        warn_of_unsupported(model, targets)
        self._gl, self._size = gl, size
        self._resources = resources = Resources(gl, self)
        self._format = frame_format = FrameFormat(size, samples, alpha, linear)
        _check_memory(gl, frame_format)
        with gl:
            assets = Assets(model, resources)
            self._light = light = SceneLight(assets, lighting)
            geoms = [geom for geom in visible_geoms(model) if geom not in targets]
            plane = find_floor(model, geoms)
            self._floor = floor = None if plane is None else Floor(assets, plane)
            self._scene = scene = DrawnScene(assets, targets, [geom for geom in geoms if geom != plane], size)
            self._frame = FrameUniforms(resources)
            count = light.options["SHADOWS"]
            self._shadows = ShadowMaps(resources, count, size[1])
            options = {**light.options, "TRANSMISSION": int(bool(scene.transparent))}
            self._occlusion = FloorOcclusion(resources, options, floor)
            self._shading = DeferredShading(resources, frame_format, floor, options)
            self._transmission, self._layers = None, None
            if scene.transparent:
                self._transmission = TransmissionMaps(resources, count, self._shadows.size // _TRANSMISSION_TEXEL)
                self._layers = TransparentLayers(resources, frame_format, self._shading)
            self._mirror = None
            if floor is not None and floor.reflects and not alpha:
                self._mirror = Mirror(resources, frame_format, floor, options)
            self._buffers: SurfaceBuffers | None = None
        self._readback = Readback(resources, frame_format)

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the GPU; the renderer cannot be used afterwards."""
        self._resources.release()

    def set_heatmap(self, geom: int, values: NDArray[np.float32], limit: float) -> None:
        """Set the field that a target with `heatmap_colors` shows from now on.

        Parameters
        ----------
        geom : int
            Geom id of the target.
        values : float32 [C, n + 2, n + 2]
            With a halo, as a height map has it.
        limit : float
            The colours range from -limit to limit.

        Raises
        ------
        RippleError
            If the geom is no target or has no heatmap, or the values or the limit are invalid.
        """
        with self._gl:
            self._scene.target(geom).set_heatmap(values, limit)

    def render(
        self, data: Any, height_maps: Mapping[int, AnyHeightMap], camera: Viewpoint, exposure: int = 0
    ) -> NDArray:
        """Draw one frame and return its pixels.

        Parameters
        ----------
        data : mujoco.MjData
            Poses of the geoms, after `mj_forward` or `mj_step`.
        height_maps : mapping
            Geom id to height map, shape [C, n + 2, n + 2, 4]: gradient of the height (xyz, in the geom's frame) and
            height [m] (w), each face with a halo of one texel. A target without one is flat. One that `HeightMap` made
            of a field on the GPU is written there.
        camera : Camera, FixedCamera or ThroughLens
        exposure : int
            Number of this exposure among those whose mean is a frame: each has another noise in its shadows.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a new array for every frame. uint8 in sRGB, alpha straight; or, of linear light, float16,
            with ITU-R BT.709's primaries, multiplied by alpha.
        """
        self.submit(data, height_maps, camera, exposure)
        return self.fetch()

    def submit(self, data: Any, height_maps: Mapping[int, AnyHeightMap], camera: Viewpoint, exposure: int = 0) -> None:
        """Draw one frame as `render` does without waiting for it; `fetch` returns frames in the order of submission."""
        with self._gl:
            self._readback.submit(self.draw(data, height_maps, camera, exposure))

    def fetch(self) -> NDArray:
        """Wait for the earliest submitted frame, and return it as `render` does."""
        return self._readback.fetch()

    def draw(
        self, data: Any, height_maps: Mapping[int, AnyHeightMap], camera: Viewpoint, exposure: int = 0
    ) -> moderngl.Framebuffer:
        """Draw one frame and leave it on the GPU.

        Returns
        -------
        moderngl.Framebuffer
            RGBA8 in sRGB, or RGBA16F of linear light; bottom row first, multiplied by alpha. The next frame is drawn
            over it.
        """
        scene, shading, pose = self._scene, self._shading, camera.pose()
        with self._gl as ctx:
            scene.update(ctx, data, height_maps, pose)
            shading.clear(ctx)  # which a software driver does during what follows
            self._update(data, pose, exposure)
            self._draw_maps(ctx)
            shading.begin(ctx)
            scene.draw()
            balls = scene.balls(data)
            boxes = boxes_of(balls, pose, self._size)
            if self._gl.software:  # which would draw all this in the next call, holding the interpreter's lock
                self._gl.wait()
            self._occlusion.average()
            if self._mirror is not None:
                self._mirror.draw(ctx, self._frame, pose, balls, scene.draw, self._bind)
            self._bind()
            shading.shade(ctx, boxes)
            if self._layers is not None:
                for bounds, layer in scene.layers(data, pose):
                    self._layers.add(ctx, layer.numbers[0], layer.draw, boxes_of(bounds, pose, self._size))
        return shading.frame

    def surfaces(
        self,
        data: Any,
        height_maps: Mapping[int, AnyHeightMap],
        camera: Viewpoint,
        size: tuple[int, int] | None = None,
    ) -> SurfaceImage:
        """Draw what is seen at the middle of each pixel, without light: distances, normals, geoms.

        Transparent objects count as solid. Arguments are as for `render`; `size` (width, height) may be another than
        that of the frames, of the same shape.
        """
        scene, pose, size = self._scene, camera.pose(), size or self._size
        with self._gl as ctx:
            if self._buffers is None or self._buffers.size != size:
                floor_geom = -1 if self._floor is None else self._floor.geom
                self._buffers = SurfaceBuffers(self._resources, size, floor_geom)
            scene.update(ctx, data, height_maps, pose)
            self._update(data, pose, 0)
            scene.height_maps.bind()

            def draw() -> None:
                for each in (*scene.opaque, *scene.transparent):
                    each.draw()

            return self._buffers.draw(ctx, draw)

    def _update(self, data: Any, pose: Pose, exposure: int) -> None:
        """Bring the frame's uniforms up to date."""
        frame, floor = self._frame, self._floor
        frame.set_camera(pose, self._format.aspect)
        casters = within(self._scene.casters(data), pose.focus, _SHADOW_REACH * pose.distance)
        centre, radius = enclosing(casters) if len(casters) else (pose.focus, pose.distance)
        if floor is not None:
            floor.place(frame, data, centre, radius)
            lights = self._light.set(frame, data, pose, floor.albedo, floor.normal)
        else:
            lights = self._light.set(frame, data, pose)
        casting = self._shadows.fit(frame, lights, centre, radius)
        if floor is not None and len(casters):
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
        self._scene.height_maps.bind()
        self._shadows.bind()
        if self._transmission is not None:
            self._transmission.bind()
        self._occlusion.bind()
        if self._floor is not None:
            self._floor.bind()
        self._light.bind()
        if self._mirror is not None:
            self._mirror.bind()


def _check_memory(gl: GLContext, frame: FrameFormat) -> None:
    """A software driver takes the machine's memory; a GPU says itself that it has too little."""
    if gl.software:
        width, height = frame.size
        need = width * height * (_PIXEL + _SAMPLE * max(frame.samples, 1))
        require_memory(RippleError, need, f"drawing frames of {width}x{height} pixels", "take smaller frames")
