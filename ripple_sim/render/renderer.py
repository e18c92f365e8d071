"""The renderer: a MuJoCo model and its rippled targets, drawn headless into frames.

The passes of one frame in their order: shadow maps, floor map, reflection, G-buffer, shading, transparent layers.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.passes.deferred import DeferredShading, Mirror
from ripple_sim.render.passes.floor import Floor, FloorOcclusion, find_floor
from ripple_sim.render.passes.layers import SurfaceBuffers, SurfaceImage, boxes_of
from ripple_sim.render.passes.shadow import ShadowMaps, TransmissionMaps
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.visuals.geoms import warn_of_unsupported
from ripple_sim.render.visuals.instances import Assets
from ripple_sim.render.visuals.visual import visible_geoms
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.files import require_memory
from ripple_sim.solver.gl import GLContext

from .camera import Pose, Viewpoint, enclosing, within
from .resources import AnyHeightMap, FrameUniforms, Resources
from .scene import DrawnScene, SceneLight
from .targets import FrameFormat, Readback

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
        frame_format = FrameFormat(size, samples, alpha, linear)
        _check_memory(gl, frame_format)
        with gl:
            assets = Assets.of(model, resources)
            light = SceneLight(assets, lighting)
            geoms = [geom for geom in visible_geoms(model) if geom not in targets]
            plane = find_floor(model, geoms)
            floor = None if plane is None else Floor(assets, plane)
            self._scene = DrawnScene(assets, targets, [geom for geom in geoms if geom != plane], size)
            self._passes = FramePasses(resources, frame_format, self._scene, floor, light)
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
            self._scene.set_heatmap(geom, values, limit)

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
        return self._passes.surfaces(data, height_maps, camera.pose(), size or self._size)

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
        return self._passes.draw(data, height_maps, camera.pose(), exposure)


def _check_memory(gl: GLContext, frame: FrameFormat) -> None:
    """A software driver takes the machine's memory; a GPU says itself that it has too little."""
    if gl.software:
        width, height = frame.size
        need = width * height * (_PIXEL + _SAMPLE * max(frame.samples, 1))
        require_memory(RippleError, need, f"drawing frames of {width}x{height} pixels", "take smaller frames")
