"""The renderer: a MuJoCo model and its rippled targets, drawn headless into frames.

The passes of one frame in their order: shadow maps, floor map, reflection, G-buffer, shading,
transparent layers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.passes.deferred import DeferredShading, Mirror, TransparentLayers
from ripple_sim.render.passes.floor import Floor, find_floor
from ripple_sim.render.passes.floor_occlusion import FloorOcclusion
from ripple_sim.render.passes.shadows import ShadowMaps, TransmissionMaps
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.visuals.lights import SceneLight, in_studio
from ripple_sim.render.visuals.objects import Assets
from ripple_sim.render.visuals.surroundings import RenderFlags
from ripple_sim.solver.errors import RippleError, warn_caller
from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.memory import require_memory

from .bounds import boxes_of, enclosing, within
from .camera import Viewpoint
from .drawn_scene import DrawnScene
from .frame_uniforms import FrameUniforms
from .height_map_textures import AnyHeightMap
from .pose import Pose
from .readback import FrameFormat, Readback
from .resources import Resources
from .shown_scene import ShownScene
from .surface_image import SurfaceBuffers, SurfaceImage

_TRANSMISSION_TEXEL = 4  # of the transmission maps, in texels of the shadow maps
_SHADOW_REACH = 2.5  # casters further than that from the focus, in camera distances, cast no shadow
_MOST_GEOMS = 10_000  # of a scene, as of mujoco.Renderer
# Memory for a pixel and for each of its samples, at least [bytes].
_PIXEL = 8
_SAMPLE = 20


class _Passes(NamedTuple):
    """The passes of a frame that depend on what there is; those that nothing needs are None."""

    occlusion: FloorOcclusion
    shading: DeferredShading
    transmission: TransmissionMaps | None
    layers: TransparentLayers | None
    mirror: Mirror | None


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
        "model": the lights and the skybox of the MJCF; "studio": a photo studio in their place;
        "auto": the studio where the MJCF has no light.
    backdrop : bool
        Whether the floor fades into a backdrop or the horizon of the skybox; see `SceneLight`.
    alpha : bool
        Frames have an alpha channel: the background is transparent, and only the shadows are left
        of the floor.
    linear : bool
        Frames are linear light without tone mapping, in half floats.

    Raises
    ------
    RippleError
        If the driver cannot make frames of this size, or memory holds none, a look or the lighting
        is unknown, or linear frames are to show a heatmap or a grid, whose colours are the
        screen's.
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
        backdrop: bool = True,
        alpha: bool = False,
        linear: bool = False,
    ) -> None:
        if linear and any(
            surface.heatmap_colors is not None or surface.grid for surface in targets.values()
        ):
            raise RippleError(
                "heatmaps and grids have the screen's colours, which linear light lacks: take "
                "linear=False"
            )
        self._gl = gl
        self._model = model
        self._size = size
        self._resources = resources = Resources(gl, self)
        self._format = frame_format = FrameFormat(size, samples, alpha, linear)
        # which takes the machine's memory; a GPU says itself that it has too little
        if gl.software:
            width, height = size
            need = width * height * (_PIXEL + _SAMPLE * max(samples, 1))
            require_memory(
                RippleError,
                need,
                f"drawing frames of {width}x{height} pixels",
                "take smaller frames",
            )
        with gl:
            self._assets = assets = Assets(model, resources)
            self._backdrop = backdrop or in_studio(model, lighting)
            self._light = SceneLight(assets, lighting, backdrop)
            plane = find_floor(model, targets)
            self._floor = None if plane is None else Floor(assets, plane)
            self._scene = DrawnScene(assets, targets, size)
            self._shown = ShownScene(model, targets, plane, cut_out=alpha)
            self._own_scene = mujoco.MjvScene(model, _MOST_GEOMS)
            self._told: set[str] = set()
            self._frame = FrameUniforms(resources)
            self._shadow_maps: dict[int, ShadowMaps] = {}
            self._made_passes: dict[tuple[int, ...], _Passes] = {}
            self._choose_passes()
            self._buffers: SurfaceBuffers | None = None
        self._readback = Readback(resources, frame_format)

    def _choose_passes(self) -> None:
        """Take the passes for what is drawn; those that were made before are kept."""
        floor = self._floor
        transparent = bool(self._scene.transparent)
        options = self._light.options
        floor_kind = floor is not None and floor.tiled, floor is not None and floor.reflects
        kind = transparent, *floor_kind, *options.values()
        if options["SHADOWS"] not in self._shadow_maps:
            self._shadow_maps[options["SHADOWS"]] = ShadowMaps(
                self._resources, options["SHADOWS"], self._size[1]
            )
        self._shadows = self._shadow_maps[options["SHADOWS"]]
        if kind not in self._made_passes:
            self._made_passes[kind] = self._make_passes(transparent)
        self._occlusion, self._shading, self._transmission, self._layers, self._mirror = (
            self._made_passes[kind]
        )

    def _make_passes(self, transparent: bool) -> _Passes:
        """Make the passes for what is drawn, with something transparent or without."""
        resources = self._resources
        floor = self._floor
        options = {**self._light.options, "TRANSMISSION": int(transparent)}
        occlusion = FloorOcclusion(resources, options, floor)
        shading = DeferredShading(resources, self._format, floor, options)
        transmission = None
        layers = None
        mirror = None
        if transparent:
            texels = self._shadows.size // _TRANSMISSION_TEXEL
            transmission = TransmissionMaps(resources, options["SHADOWS"], texels)
            layers = TransparentLayers(resources, self._format, shading)
        if floor is not None and floor.reflects and not self._format.alpha:
            mirror = Mirror(resources, self._format, floor, options)
        return _Passes(occlusion, shading, transmission, layers, mirror)

    def _show(
        self, data: Any, scene: mujoco.MjvScene | None, pose: Pose, segmented: bool = False
    ) -> Any:
        """Draw what a scene of MuJoCo's has, by default all that it shows of the data, with surfaces for the targets.

        Surfaces of targets that MuJoCo shows by default are drawn only if the scene has the target.
        What is `segmented` has a `segid`. Planes are seen from the `pose`. What is not drawn is
        told once. Return where geoms and sites are, as the scene has them.
        """
        shown = self._shown
        edited = scene is not None
        if scene is None:
            scene = self._own_scene
            kinds = int(mujoco.mjtCatBit.mjCAT_ALL)
            mujoco.mjv_updateScene(
                self._model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), kinds, scene
            )
        self._assets.refresh()
        if shown.read(scene, pose.position, segmented, self._assets, doubled=edited):
            self._scene.show(shown.visuals, shown.targets, shown.hidden)
            if self._floor is not None:
                self._floor.shown = shown.floor is not None
                if shown.floor is not None:
                    self._floor.paint(shown.floor)
            self._warn_of(shown.left_out)
        self._choose_passes()
        return shown.poses(data) if edited else data

    def _warn_of(self, left_out: set[str]) -> None:
        """Say what is not drawn as the scene has it, once each."""
        if new := left_out - self._told:
            self._told |= new
            warn_caller(f"not drawn: {', '.join(sorted(new))}; all else of the scene is")

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the GPU; the renderer cannot be used afterwards."""
        self._resources.release()

    def watch(self) -> None:
        """See what a program writes into the model's textures, height fields and meshes from now on."""
        self._assets.watch()

    def upload(self, kind: str, index: int) -> None:
        """Take a "texture", "hfield" or "mesh" of the model, by its id, as it is now."""
        with self._gl:
            self._assets.upload(kind, index)

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
        self,
        data: Any,
        height_maps: Mapping[int, AnyHeightMap],
        camera: Viewpoint,
        exposure: int = 0,
        scene: mujoco.MjvScene | None = None,
        lights: Sequence[mujoco.MjvLight] | None = None,
    ) -> NDArray:
        """Draw one frame and return its pixels.

        Parameters
        ----------
        data : mujoco.MjData
            Poses of the geoms, after `mj_forward` or `mj_step`.
        height_maps : mapping
            Geom id to height map, shape [C, n + 2, n + 2, 4]: gradient of the height (xyz, in the
            geom's frame) and height [m] (w), each face with a halo of one texel. A target without
            one is flat. One that `HeightMap` made of a field on the GPU is written there.
        camera : Camera, FixedCamera or ThroughLens
        exposure : int
            Number of this exposure among those whose mean is a frame: each has another noise in its
            shadows.
        scene : mujoco.MjvScene, optional
            What is drawn beside the targets, and which of them; by default what MuJoCo shows of the
            data.
        lights : sequence of mujoco.MjvLight, optional
            Those of the scene, where they are to replace the model's.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a new array for every frame. uint8 in sRGB, alpha straight; or, of linear
            light, float16, with ITU-R BT.709's primaries, multiplied by alpha.
        """
        try:
            self.submit(data, height_maps, camera, exposure, scene, lights)
            return self.fetch()
        except BaseException:
            self._readback.forget()  # else the next call would return this frame
            raise

    def submit(
        self,
        data: Any,
        height_maps: Mapping[int, AnyHeightMap],
        camera: Viewpoint,
        exposure: int = 0,
        scene: mujoco.MjvScene | None = None,
        lights: Sequence[mujoco.MjvLight] | None = None,
    ) -> None:
        """Draw one frame as `render` does without waiting for it; `fetch` returns frames in the order of submission."""
        with self._gl:
            self._readback.submit(self.draw(data, height_maps, camera, exposure, scene, lights))

    def fetch(self) -> NDArray:
        """Wait for the earliest submitted frame, and return it as `render` does."""
        return self._readback.fetch()

    def draw(
        self,
        data: Any,
        height_maps: Mapping[int, AnyHeightMap],
        camera: Viewpoint,
        exposure: int = 0,
        scene: mujoco.MjvScene | None = None,
        lights: Sequence[mujoco.MjvLight] | None = None,
    ) -> moderngl.Framebuffer:
        """Draw one frame and leave it on the GPU.

        Returns
        -------
        moderngl.Framebuffer
            RGBA8 in sRGB, or RGBA16F of linear light; bottom row first, multiplied by alpha. The
            next frame is drawn over it.
        """
        drawn = self._scene
        pose = camera.pose()
        with self._gl as ctx, self._resources.drawing():
            self._light.make_room(lights)
            poses = self._show(data, scene, pose)
            shading = self._shading
            drawn.update(ctx, poses, height_maps, pose)
            shading.clear(ctx)
            self._gl.flush()
            flags = RenderFlags.of(scene)
            self._update(data, poses, pose, exposure, flags, lights)
            # what shading looks up; a software driver stops for each texture that it is still
            # drawing to
            ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            ctx.depth_func = "<="
            self._shadows.draw(drawn.cast)
            self._gl.flush()
            self._occlusion.look_up(ctx, drawn.cast)
            self._gl.flush()
            self._shadows.find_blockers(ctx)
            self._gl.flush()
            if self._transmission is not None:
                self._transmission.draw(self._shadows.views, drawn.cast)
                self._transmission.bind()
                self._gl.flush()
            self._occlusion.shade(ctx, self._shadows)
            self._gl.flush()
            shading.begin(ctx)
            drawn.draw()
            balls = drawn.balls(poses)
            boxes = boxes_of(balls, pose, self._size)
            # which would draw all this in the next call, holding the interpreter's lock
            if self._gl.software:
                self._gl.wait()
            self._occlusion.average()
            if self._mirror is not None and not flags.reflection and not self._backdrop:
                self._mirror.hide()
            elif self._mirror is not None and self._floor is not None and self._floor.shown:
                self._mirror.draw(ctx, self._frame, pose, balls, drawn.draw, self._bind)
            self._bind()
            shading.shade(ctx, boxes)
            if self._layers is not None:
                for bounds, layer in drawn.layers(poses, pose):
                    self._layers.add(
                        ctx, layer.numbers[0], layer.draw, boxes_of(bounds, pose, self._size)
                    )
        return shading.frame

    def surfaces(
        self,
        data: Any,
        height_maps: Mapping[int, AnyHeightMap],
        camera: Viewpoint,
        size: tuple[int, int] | None = None,
        scene: mujoco.MjvScene | None = None,
        segmented: bool = False,
    ) -> SurfaceImage:
        """Draw what is seen at the middle of each pixel, without light: distances, normals, geoms.

        Transparent objects count as solid. Arguments are as for `render`; `size` (width, height)
        may be another than that of the frames, of the same shape. Of a `scene` there are MuJoCo's
        shapes: boxes and cylinders without round edges; if `segmented`, only what MuJoCo would
        segment.
        """
        drawn = self._scene
        pose = camera.pose()
        size = size or self._size
        with self._gl as ctx, self._resources.drawing():
            if self._buffers is None or self._buffers.size != size:
                self._buffers = SurfaceBuffers(self._resources, size)
            poses = self._show(data, scene, pose, segmented)
            drawn.update(ctx, poses, height_maps, pose, sharp=scene is not None)
            self._update(data, poses, pose, 0, RenderFlags())
            drawn.height_maps.bind()

            def draw() -> None:
                for each in (*drawn.opaque, *drawn.transparent):
                    each.draw()

            return self._buffers.draw(
                ctx, draw, self._assets.objects, -1 if self._floor is None else self._floor.geom
            )

    def _update(
        self,
        data: Any,
        poses: Any,
        pose: Pose,
        exposure: int,
        flags: RenderFlags,
        lights: Sequence[mujoco.MjvLight] | None = None,
    ) -> None:
        """Bring the frame's uniforms up to date; `poses` are those of geoms and sites."""
        frame = self._frame
        floor = self._floor
        frame.set_camera(pose, self._format.aspect, self._scene.balls(poses))
        casters = within(
            self._scene.casters(poses, pose.distance), pose.focus, _SHADOW_REACH * pose.distance
        )
        centre, radius = enclosing(casters) if len(casters) else (pose.focus, pose.distance)
        if floor is not None:
            floor.place(frame, poses, centre, radius)
            ground = floor.origin if floor.endless and floor.shown else None
            shining = self._light.set(
                frame, data, pose, floor.albedo, floor.normal, lights, flags=flags, ground=ground
            )
        else:
            shining = self._light.set(frame, data, pose, lights=lights, flags=flags)
        if lights is not None and self._light.studio:
            self._warn_of({"lights of the scene, which the studio replaces"})
        casting = self._shadows.fit(frame, shining, centre, radius)
        if floor is not None and len(casters):
            floor.shade(frame, casting, casters)
        frame.set_vector("counts", [0, len(shining), exposure], len(casting))
        frame.bind()

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
