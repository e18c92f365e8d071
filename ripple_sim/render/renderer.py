"""The renderer: a MuJoCo model and its rippled targets, drawn headless into frames."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.passes.floor import Floor, find_floor
from ripple_sim.render.passes.surface_buffers import SurfaceImage
from ripple_sim.render.surfaces.surface import Surface
from ripple_sim.render.visuals.assets import Assets
from ripple_sim.render.visuals.unsupported import warn_of_unsupported
from ripple_sim.render.visuals.visual import visible_geoms
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.files import require_memory
from ripple_sim.solver.gl import GLContext

from .camera import Viewpoint
from .frame_format import FrameFormat
from .frame_passes import FramePasses
from .height_maps import AnyHeightMap
from .resources import Resources
from .scene import DrawnScene
from .scene_light import SceneLight
from .targets import Readback

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
