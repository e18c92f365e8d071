"""The renderer: a MuJoCo model and its rippled targets, drawn headless into frames.

The passes of one frame in their order: shadow maps, floor map, G-buffer, reflection, shading,
transparent layers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId
from ripple_sim.render.passes.deferred import DeferredShading, Mirror, TransparentLayers
from ripple_sim.render.passes.floor import Floor, find_floor
from ripple_sim.render.passes.floor_occlusion import FloorOcclusion
from ripple_sim.render.passes.shadows import ShadowMaps, TransmissionMaps
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.visuals.objects import Assets
from ripple_sim.render.visuals.scene_light import SceneLight, in_studio
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

# Edge of a texel of the transmission maps [texels of the shadow maps].
_TRANSMISSION_TEXEL = 4

# Objects farther than this from the focus cast no shadow [distances of the focus].
_MAX_CASTER_DISTANCE = 2.5

# Greatest number of geoms of a scene, as in `mujoco.Renderer`.
_MAX_GEOMS = 10_000

# Least memory for a pixel, and for each of its samples [bytes].
_BYTES_PER_PIXEL = 8
_BYTES_PER_SAMPLE = 20


class _Passes(NamedTuple):
    """The passes that depend on the contents of the frame; passes that nothing needs are None."""

    occlusion: FloorOcclusion
    shading: DeferredShading
    transmission: TransmissionMaps | None
    layers: TransparentLayers | None
    mirror: Mirror | None


def _check_screen_colors(targets: Mapping[TargetId, Surface]) -> None:
    """Raise `RippleError` if a target shows a heatmap or a grid, which linear frames cannot."""
    for surface in targets.values():
        if surface.heatmap_colors is not None or surface.grid:
            raise RippleError(
                "heatmaps and grids have the screen's colours, which linear light lacks: take "
                "linear=False"
            )


def _require_memory_for_frames(size: tuple[int, int], samples: int) -> None:
    """Raise `RippleError` if the machine's memory is too small for frames of a size."""
    width, height = size
    bytes_per_pixel = _BYTES_PER_PIXEL + _BYTES_PER_SAMPLE * max(samples, 1)
    purpose = f"drawing frames of {width}x{height} pixels"
    require_memory(RippleError, width * height * bytes_per_pixel, purpose, "take smaller frames")


class Renderer:
    """Draws a MuJoCo model and its rippled targets into frames, headless.

    Parameters
    ----------
    gl : GLContext
    model : mujoco.MjModel
    targets : mapping
        Geom id to the surface that is drawn instead of the geom.
    size : (width, height)
        Size of a frame [pixels].
    samples : int
        Samples a pixel for smooth edges; at most as many as the driver has. With 0 or 1 edges are
        not smoothed.
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
        If the driver cannot make frames of this size, memory is too small for a frame, a look or
        the lighting is unknown, or linear frames are to show a heatmap or a grid, whose colours are
        the screen's.
    """

    def __init__(
        self,
        gl: GLContext,
        model: Any,
        targets: Mapping[TargetId, Surface],
        *,
        size: tuple[int, int],
        samples: int = 4,
        lighting: str = "auto",
        backdrop: bool = True,
        alpha: bool = False,
        linear: bool = False,
    ) -> None:
        if linear:
            _check_screen_colors(targets)
        if gl.software:  # frames are in the machine's memory
            _require_memory_for_frames(size, samples)
        self._gl = gl
        self._model = model
        self._size = size
        self._format = FrameFormat(size, samples, alpha, linear)
        self._resources = Resources(gl, self)
        with gl:
            self._assets = Assets(model, self._resources)
            self._backdrop = backdrop or in_studio(model, lighting)
            self._light = SceneLight(self._assets, lighting, backdrop)
            plane = find_floor(model, targets)
            self._floor = None if plane is None else Floor(self._assets, plane)
            self._scene = DrawnScene(self._assets, targets, size)
            self._shown = ShownScene(model, targets, plane, cut_out=alpha)
            # the scene that is drawn unless `render` is given one
            self._own_scene = mujoco.MjvScene(model, _MAX_GEOMS)
            self._warned_of: set[str] = set()
            self._frame = FrameUniforms(self._resources)
            self._shadow_maps_by_count: dict[int, ShadowMaps] = {}
            self._passes_by_kind: dict[tuple[int, ...], _Passes] = {}
            self._choose_passes()
            self._buffers: SurfaceBuffers | None = None
        self._readback = Readback(self._resources, self._format)

    def _choose_passes(self) -> None:
        """Choose the passes for the contents of the frame; passes are made once and kept."""
        floor = self._floor
        options = self._light.options
        shadow_count = options["SHADOWS"]
        if shadow_count not in self._shadow_maps_by_count:
            maps = ShadowMaps(self._resources, shadow_count, self._size[1])
            self._shadow_maps_by_count[shadow_count] = maps
        self._shadows = self._shadow_maps_by_count[shadow_count]
        has_transparent = bool(self._scene.transparent)
        is_tiled = floor is not None and floor.tiled
        is_mirror = floor is not None and floor.reflects
        kind = (has_transparent, is_tiled, is_mirror, *options.values())
        if kind not in self._passes_by_kind:
            self._passes_by_kind[kind] = self._make_passes(has_transparent)
        passes = self._passes_by_kind[kind]
        self._occlusion = passes.occlusion
        self._shading = passes.shading
        self._transmission = passes.transmission
        self._layers = passes.layers
        self._mirror = passes.mirror

    def _make_passes(self, transparent: bool) -> _Passes:
        """Make the passes for the contents of the frame, with transparent objects or without."""
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
        """Choose the contents of the frame: those of a scene, with surfaces for the targets.

        Parameters
        ----------
        scene : mujoco.MjvScene, optional
            By default the scene that MuJoCo makes of the data. A target that MuJoCo shows by
            default is drawn only if the scene contains it.
        pose : Pose
            Pose of the camera. Planes look different from behind.
        segmented : bool
            Whether entries without a `segid` are left out.

        Returns
        -------
        mujoco.MjData, or an object with its names
            Poses of geoms and sites, as the scene has them.
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
            self._warn_of_left_out(shown.left_out)
        self._choose_passes()
        return shown.poses(data) if edited else data

    def _warn_of_left_out(self, left_out: set[str]) -> None:
        """Warn once of each thing that is not drawn as the scene has it."""
        new = left_out - self._warned_of
        if new:
            self._warned_of |= new
            warn_caller(f"not drawn: {', '.join(sorted(new))}; all else of the scene is")

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the GPU; the renderer cannot be used afterwards."""
        self._resources.release()

    def watch(self) -> None:
        """Check from now on whether a program changes the model's textures or shapes.

        The shapes are its height fields and meshes.
        """
        self._assets.watch()

    def upload(self, kind: str, index: int) -> None:
        """Read a "texture", "hfield" or "mesh" of the model again, by its id."""
        with self._gl:
            self._assets.upload(kind, index)

    def set_heatmap(self, geom: TargetId, values: NDArray[np.float32], limit: float) -> None:
        """Set the field that a target with `heatmap_colors` shows.

        Parameters
        ----------
        geom : int
            Geom id of the target.
        values : float32 [C, n + 2, n + 2]
            Values with a halo of one texel, as in a height map.
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
        height_maps: Mapping[TargetId, AnyHeightMap],
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
            geom's frame) and height [m] (w), each chart with a halo of one texel. A target without
            a height map is flat. A height map that `HeightMap` made of a field on the GPU stays on
            the GPU.
        camera : Camera, FixedCamera or ThroughLens
        exposure : int
            Number of this exposure, where a frame is the mean of several: each exposure has another
            noise in its shadows.
        scene : mujoco.MjvScene, optional
            The objects that are drawn, and which targets; by default those that MuJoCo shows of the
            data.
        lights : sequence of mujoco.MjvLight, optional
            Lights of the scene, if they replace the model's.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a new array for every frame. sRGB frames are uint8, not multiplied by
            alpha. Linear frames are float16, with ITU-R BT.709's primaries, multiplied by alpha.
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
        height_maps: Mapping[TargetId, AnyHeightMap],
        camera: Viewpoint,
        exposure: int = 0,
        scene: mujoco.MjvScene | None = None,
        lights: Sequence[mujoco.MjvLight] | None = None,
    ) -> None:
        """Start drawing one frame as `render` does, without waiting for it.

        `fetch` returns frames in the order of submission.
        """
        with self._gl:
            self._readback.submit(self.draw(data, height_maps, camera, exposure, scene, lights))

    def fetch(self) -> NDArray:
        """Wait for the earliest submitted frame, and return it as `render` does."""
        return self._readback.fetch()

    def draw(
        self,
        data: Any,
        height_maps: Mapping[TargetId, AnyHeightMap],
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
            next frame overwrites it.
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
            self._draw_maps(ctx)
            shading.begin(ctx)
            drawn.draw()
            balls = drawn.balls(poses)
            boxes = boxes_of(balls, pose, self._size)
            # a software driver draws in the next call otherwise, and holds the interpreter's lock
            if self._gl.software:
                self._gl.wait()
            self._occlusion.average()
            self._draw_mirror(ctx, pose, balls, flags)
            self._bind()
            shading.shade(ctx, boxes)
            self._draw_layers(ctx, poses, pose)
        return shading.frame

    def _draw_maps(self, ctx: moderngl.Context) -> None:
        """Draw the maps that shading looks up: of shadows, transmission and the floor.

        A software driver stops at each texture that it is still drawing to, so the maps are
        flushed one by one.
        """
        cast = self._scene.cast
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<="
        self._shadows.draw(cast)
        self._gl.flush()
        self._occlusion.look_up(ctx, cast)
        self._gl.flush()
        self._shadows.find_blockers(ctx)
        self._gl.flush()
        if self._transmission is not None:
            self._transmission.draw(self._shadows.views, cast)
            self._transmission.bind()
            self._gl.flush()
        self._occlusion.shade(ctx, self._shadows)
        self._gl.flush()

    def _draw_mirror(
        self, ctx: moderngl.Context, pose: Pose, balls: NDArray[np.float64], flags: RenderFlags
    ) -> None:
        """Draw the reflection in the floor, unless the scene's flags hide it."""
        mirror = self._mirror
        if mirror is None:
            return
        if not flags.reflection and not self._backdrop:
            mirror.hide()
        elif self._floor is not None and self._floor.shown:
            mirror.draw(ctx, self._frame, pose, balls, self._scene.draw, self._bind)

    def _draw_layers(self, ctx: moderngl.Context, poses: Any, pose: Pose) -> None:
        """Draw the transparent objects over the frame, one after another."""
        if self._layers is None:
            return
        for balls, layer in self._scene.layers(poses, pose):
            boxes = boxes_of(balls, pose, self._size)
            self._layers.add(ctx, layer.numbers[0], layer.draw, boxes)

    def surfaces(
        self,
        data: Any,
        height_maps: Mapping[TargetId, AnyHeightMap],
        camera: Viewpoint,
        size: tuple[int, int] | None = None,
        scene: mujoco.MjvScene | None = None,
        segmented: bool = False,
    ) -> SurfaceImage:
        """Draw distances, normals and geoms at the middle of each pixel, without light.

        Transparent objects count as solid. Arguments are as for `render`. `size` (width, height)
        may differ from the frames' size, but not its proportions. Objects of a `scene` have
        MuJoCo's shapes: boxes and cylinders without round edges. If `segmented`, only objects that
        MuJoCo would segment are drawn.
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

            def draw_objects() -> None:
                for drawable in (*drawn.opaque, *drawn.transparent):
                    drawable.draw()

            floor_geom = -1 if self._floor is None else self._floor.geom
            return self._buffers.draw(ctx, draw_objects, self._assets.objects, floor_geom)

    def _update(
        self,
        data: Any,
        poses: Any,
        pose: Pose,
        exposure: int,
        flags: RenderFlags,
        lights: Sequence[mujoco.MjvLight] | None = None,
    ) -> None:
        """Bring the frame's uniforms up to date; `poses` has the poses of geoms and sites."""
        frame = self._frame
        floor = self._floor
        frame.set_camera(pose, self._format.aspect, self._scene.balls(poses))
        casters = self._scene.casters(poses, pose.distance)
        casters = within(casters, pose.focus, _MAX_CASTER_DISTANCE * pose.distance)
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
            self._warn_of_left_out({"lights of the scene, which the studio replaces"})
        casting = self._shadows.fit(frame, shining, centre, radius)
        if floor is not None and len(casters):
            floor.shade(frame, casting, casters)
        frame.set_vector("counts", [0, len(shining), exposure], len(casting))
        frame.bind()

    def _bind(self) -> None:
        """Bind the maps and textures that shading looks up."""
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
