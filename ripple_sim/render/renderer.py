"""One frame: shadow maps, floor occlusion, the visible surfaces, their light, and the way back to memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.frame_uniforms import FrameUniforms
from ripple_sim.render.gpu.object_table import ObjectTable
from ripple_sim.render.gpu.readback import Readback
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.render.passes.deferred import Picture
from ripple_sim.render.passes.floor import Floor, find_floor
from ripple_sim.render.passes.mirror import Mirror
from ripple_sim.render.passes.screen_bounds import boxes_of
from ripple_sim.render.passes.shadow import ShadowMaps
from ripple_sim.render.surfaces.height_maps import HeightMapTextures
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.surfaces.surface_mesh import SurfaceMesh
from ripple_sim.render.visuals.geoms import Bodies
from ripple_sim.render.visuals.lights import (
    casting_lamps,
    has_near_lamps,
    is_lit,
    model_lighting,
    set_lighting,
    studio_lighting,
)
from ripple_sim.render.visuals.materials import Textures
from ripple_sim.render.visuals.unsupported import warn_of_undrawn
from ripple_sim.render.visuals.visual import ball_of, visible_geoms
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.gl import GLContext

from .camera import Pose, Viewpoint

LIGHTING = ("auto", "model", "studio")
_SHADOW_REACH = 2.5  # what is further from the focus, in camera distances, casts no shadow


class Renderer:
    """Draws a MuJoCo model and its rippled targets into frames, headless.

    Parameters
    ----------
    gl : GLContext
    model : mujoco.MjModel
    targets : mapping
        Geom id to the surface that is drawn in place of the geom.
    width, height : int
        Frame size [pixels].
    samples : int
        Samples a pixel for smooth edges; at most what the driver has. 0 or 1: none.
    lighting : str
        "model": the lamps and the skybox of the MJCF; "studio": a photo studio in their place; "auto": the studio
        where the MJCF sets no lamp.
    alpha : bool
        Frames have an alpha channel: the background is transparent, and of the floor nothing but the shadows is left.
    linear : bool
        Frames are linear light as it was before tone mapping, in half floats.

    Raises
    ------
    RippleError
        If the driver cannot make frames of this size, a look or the lighting is unknown, or linear frames are to show a
        field or a grid, whose colours are the screen's.
    """

    def __init__(
        self,
        gl: GLContext,
        model: Any,
        targets: Mapping[int, Surface],
        *,
        width: int,
        height: int,
        samples: int = 4,
        lighting: str = "auto",
        alpha: bool = False,
        linear: bool = False,
    ) -> None:
        if lighting not in LIGHTING:
            raise RippleError(f"lighting is {lighting!r}; valid are {', '.join(map(repr, LIGHTING))}")
        if linear and any(surface.field_colors is not None or surface.grid for surface in targets.values()):
            raise RippleError("fields and grids have the screen's colours, which linear light lacks: take linear=False")
        warn_of_undrawn(model)
        self.width, self.height = width, height
        self._gl, self._model = gl, model
        self._studio = lighting == "studio" or (lighting == "auto" and not is_lit(model))
        self._owned = ctx = OwnedObjects(gl, self)
        with gl:
            self._frame = FrameUniforms(ctx)
            shadows = 1 if self._studio else casting_lamps(model)
            self._shadows = ShadowMaps(ctx, shadows)
            self._table = ObjectTable(ctx)
            self._open_floor = ctx.texture((1, 1), 2, np.ones(2, dtype=np.float16).tobytes(), dtype="f2")
            textures = Textures(ctx, model)
            self._sky = None if self._studio else textures.skybox()
            self._height_maps = HeightMapTextures(ctx, [surface.resolution for surface in targets.values()])
            self._targets = [
                SurfaceMesh(
                    gl, ctx, model, geom, surface, textures, self._table, self._height_maps, index, (width, height)
                )
                for index, (geom, surface) in enumerate(sorted(targets.items()))
            ]
            geoms = [geom for geom in visible_geoms(model) if geom not in targets]
            floor = find_floor(model, geoms)
            self._floor = None if floor is None else Floor(gl, ctx, model, floor, textures, shadows)
            options = {
                "SKYBOX": int(self._sky is not None),
                "NEAR_LAMPS": int(not self._studio and has_near_lamps(model)),
                "SHADOWS": shadows,
                "LINEAR": int(linear),
            }
            self._picture = Picture(
                gl, ctx, (width, height), samples=samples, cut_out=alpha, floor=self._floor, options=options
            )
            self._mirror = None
            if self._floor is not None and self._floor.reflectance > 0.0 and not alpha:
                self._mirror = Mirror(gl, ctx, (width, height), options)
            self._bodies = Bodies(gl, ctx, model, [geom for geom in geoms if geom != floor], textures, self._table)
        self._readback = Readback(gl, ctx, (width, height), alpha=alpha, linear=linear)

    def __enter__(self) -> Renderer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release everything on the GPU; the renderer cannot be used afterwards."""
        self._owned.release()

    def set_field(self, geom: int, field: NDArray[np.float32], limit: float) -> None:
        """Set the scalar field that a target with `field_colors` shows from now on.

        Parameters
        ----------
        geom : int
            Geom id of the target.
        field : float32 [6, N + 2, N + 2]
            Padded by a ring of neighbour texels, as a height map.
        limit : float
            The colours reach from -limit to limit.
        """
        with self._gl:
            next(target for target in self._targets if target.geom == geom).set_field(field, limit)

    def render(
        self, data: Any, height_maps: Mapping[int, NDArray[np.float32]], camera: Viewpoint, exposure: int = 0
    ) -> NDArray:
        """Draw one frame.

        Parameters
        ----------
        data : mujoco.MjData
            Poses of the geoms, after `mj_forward` or `mj_step`.
        height_maps : mapping
            Geom id to height map, shape [6, N + 2, N + 2, 4]: gradient of the height (xyz, in the geom's frame) and
            height [m] (w), each face padded by a ring of neighbour texels. A target without one is flat.
        camera : Camera, FixedCamera or ThroughLens
        exposure : int
            Number of this picture among those whose mean is a frame: the noise of shadows differs from one to the next.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a fresh array for every frame. uint8 in sRGB, alpha straight; or, of linear light, float16,
            with ITU-R BT.709's primaries, multiplied by alpha.
        """
        self.submit(data, height_maps, camera, exposure)
        return self.fetch()

    def submit(
        self, data: Any, height_maps: Mapping[int, NDArray[np.float32]], camera: Viewpoint, exposure: int = 0
    ) -> None:
        """Draw one frame as `render` does, without waiting for it: `fetch` returns it, after those submitted before."""
        with self._gl:
            self._readback.submit(self.draw(data, height_maps, camera, exposure))

    def fetch(self) -> NDArray:
        """Wait for the earliest submitted frame, and return it as `render` does."""
        return self._readback.fetch()

    def draw(
        self, data: Any, height_maps: Mapping[int, NDArray[np.float32]], camera: Viewpoint, exposure: int = 0
    ) -> moderngl.Framebuffer:
        """Draw one frame as `render` does, and leave it on the GPU.

        Returns
        -------
        moderngl.Framebuffer
            RGBA8 in sRGB, or RGBA16F of linear light; bottom row first, multiplied by alpha. The next frame is drawn
            over it.
        """
        pose = camera.pose()
        with self._gl as ctx:
            self._update(ctx, data, height_maps, pose, exposure)
            self._draw_maps(ctx)
            if self._mirror is not None and self._floor is not None:
                self._mirror.draw(ctx, self._frame, pose, self._floor, self._balls, self._draw_solids, self._bind_maps)
            self._picture.begin(ctx)
            self._draw_solids()
            self._bind_maps()
            if self._gl.software:  # it would draw all this within the next call, which keeps other threads from running
                self._gl.wait()
            self._picture.compose(ctx, boxes_of(*self._balls, pose, (self.width, self.height)))
            self._draw_clear(ctx, data, pose)
        return self._picture.frame

    def _update(
        self,
        ctx: moderngl.Context,
        data: Any,
        height_maps: Mapping[int, NDArray[np.float32]],
        pose: Pose,
        exposure: int,
    ) -> None:
        """Bring everything on the GPU up to date."""
        occluders = self._bodies.occluders.bind(data, pose.focus)
        for target in self._targets:
            rotation = data.geom_xmat[target.geom].reshape(3, 3)
            target.update(ctx, rotation, data.geom_xpos[target.geom], height_maps.get(target.geom), occluders)
        pixels = self.height / (2 * np.tan(np.radians(pose.fovy) / 2))
        self._bodies.update(data, pose.position, pixels)
        self._table.bind()

        frame = self._frame
        self._view_projection = frame.set_camera(pose, self.width / self.height)
        bodies = self._bodies.balls(data)
        self._balls = _joined(bodies, self._bodies.planes(data), *(target.balls() for target in self._targets))
        # a target's own ball does not change as it turns, so that no map is cut anew
        casters = _near(pose, *_joined(bodies, *(target.ball() for target in self._targets)))
        centre, radius = _ball_about(*casters) if len(casters[1]) else (pose.focus, pose.distance)
        if self._floor is not None:
            self._floor.place(frame, data, centre, radius)
        lighting = studio_lighting(pose) if self._studio else model_lighting(self._model, data, pose)
        albedo = None if self._floor is None else self._floor.albedo
        set_lighting(frame, lighting, pose, albedo, None if self._sky is None else self._sky[1])
        if self._floor is not None:
            frame.set_vector("floor_light", lighting.on(pose.focus, self._floor.normal))
        casting = self._shadows.fit(frame, lighting.lights, centre, radius)
        if self._floor is not None and len(casters[1]):
            self._floor.shade(frame, casting, *casters)
        frame.set_vector("counts", [occluders, len(lighting.lights), exposure], len(casting))
        frame.bind()

    def _draw_maps(self, ctx: moderngl.Context) -> None:
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<="
        self._shadows.draw(self._draw_casters)
        if self._floor is not None:
            self._floor.occlude(ctx, self._draw_depth, self._shadows)

    def _draw_casters(self, view_projection: tuple[float, ...]) -> None:
        for target in self._targets:
            if target.shades:
                target.draw_depth(view_projection)
        self._bodies.draw_depth(view_projection, sites=True)

    def _draw_solids(self) -> None:
        for target in self._targets:
            if not target.clear:
                target.draw()
        self._bodies.draw()

    def _draw_depth(self, view_projection: tuple[float, ...]) -> None:
        for target in self._targets:
            target.draw_depth(view_projection)
        self._bodies.draw_depth(view_projection, sites=False)

    def _bind_maps(self) -> None:
        self._height_maps.bind()
        self._shadows.bind()
        if self._floor is None:
            self._open_floor.use(3)
        else:
            self._floor.bind()
        if self._sky is not None:
            self._sky[0].use(7)
        if self._mirror is not None:
            self._mirror.bind()

    def _draw_clear(self, ctx: moderngl.Context, data: Any, pose: Pose) -> None:
        """Lay whatever the scene behind shows through over the picture, the furthest first."""
        layers: list[tuple[NDArray[np.float64], NDArray[np.float64], int, Callable[[], None]]] = []
        for target in self._targets:
            if target.clear:
                layers.append((*target.balls(), target.number, target.draw))
        for body in self._bodies.clear:
            centre, radius = ball_of(self._model, data, body.piece)
            layers.append((centre[None], np.array([radius]), body.number, body.instances.draw))
        layers.sort(key=lambda layer: -float(np.linalg.norm(layer[0].mean(axis=0) - pose.eye)))
        for centres, radii, number, draw in layers:
            boxes = boxes_of(centres, radii, pose, (self.width, self.height))
            self._picture.add_layer(ctx, number, draw, boxes)


def _joined(*balls: tuple[NDArray, NDArray]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres [k, 3] and radii [k] of all balls in one list."""
    return np.concatenate([centres for centres, _ in balls]), np.concatenate([radii for _, radii in balls])


def _near(pose: Pose, centres: NDArray, radii: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Those balls that are near enough to the camera's focus to throw a shadow which shows."""
    near = np.linalg.norm(centres - pose.focus, axis=1) - radii < _SHADOW_REACH * pose.distance
    return centres[near], radii[near]


def _ball_about(centres: NDArray[np.float64], radii: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre and radius of a ball that holds others, [k, 3] and [k]."""
    centre = ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0)) / 2
    return centre, float((np.linalg.norm(centres - centre, axis=1) + radii).max())
