"""What is drawn into and read back: frames and their format, the G-buffer, and passes over a whole framebuffer.

Surface images tell what each pixel shows: distance, normal, geom, and place on the height map;
without light.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.objects import ObjectTable
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.kernel import kernel

from .contract import Unit
from .resources import Resources


@dataclass(frozen=True)
class FrameFormat:
    """Size and kind of a frame.

    Attributes
    ----------
    size : (width, height)
        [pixels].
    samples : int
        Samples a pixel for smooth edges; at most as many as the driver has. 0 or 1: none.
    alpha : bool
        Whether there is an alpha channel: the background is transparent, and only the shadows are
        left of the floor.
    linear : bool
        Whether colours are linear light in half floats, without tone mapping, in place of sRGB in
        bytes.
    """

    size: tuple[int, int]
    samples: int = 4
    alpha: bool = False
    linear: bool = False

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.size[0] / self.size[1]

    @property
    def dtype(self) -> str:
        """Type of a channel on the GPU, as moderngl names it."""
        return "f2" if self.linear else "f1"


class GBuffer:
    """Depths, normals and colours; g_buffer.glsl encodes them.

    Parameters
    ----------
    size : (width, height)
        [pixels].
    samples : int
        A pixel; at most as many as the driver has.

    Attributes
    ----------
    samples : int
        1 or more.
    """

    def __init__(self, resources: Resources, size: tuple[int, int], samples: int) -> None:
        with resources.gl as ctx:
            samples = min(samples, ctx.max_samples)
        many = samples if samples > 1 else 0
        self.samples = max(many, 1)
        depths = resources.depth_texture(size, samples=many)
        normals, colors = (resources.texture(size, 4, samples=many, dtype="nu2") for _ in range(2))
        self._textures = {Unit.DEPTHS: depths, Unit.NORMALS: normals, Unit.COLORS: colors}
        if not many:
            depths.compare_func = ""
            for texture in self._textures.values():
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._framebuffer = resources.framebuffer([normals, colors], depths)

    def use(self, ctx: moderngl.Context) -> None:
        """Draw into it from now on."""
        self._framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)

    def clear(self) -> None:
        """Forget all surfaces."""
        # the colours of samples without a surface are never read
        self._framebuffer.color_mask = [(False,) * 4] * 2
        self._framebuffer.clear(depth=1.0)
        self._framebuffer.color_mask = [(True,) * 4] * 2

    def bind(self) -> None:
        """Bind the textures for the shaders."""
        for unit, texture in self._textures.items():
            texture.use(unit)


class FramePass:
    """A fragment shader that runs over a whole framebuffer, where the depth test lets it.

    Parameters
    ----------
    name : str
        Path of the shader.
    size : (width, height)
        Of the framebuffer [pixels].
    **options
        Defines.

    Attributes
    ----------
    program : moderngl.Program
    """

    def __init__(
        self, resources: Resources, name: str, size: tuple[int, int], **options: object
    ) -> None:
        with resources.gl as ctx:
            widest = min(ctx.info["GL_MAX_VIEWPORT_DIMS"])
        # The triangle over the frame lies within a viewport twice as large: where a driver clips it
        # in two, derivatives along the cut would be undefined.
        self._reach = 2 if 2 * max(size) <= widest else 1
        self.program = resources.program(name, **options, TILES=0)
        self._triangle = resources.vertex_array(self.program, [])

    def run(self, framebuffer: moderngl.Framebuffer, level: float) -> None:
        """Run over a framebuffer, at a depth."""
        width, height = framebuffer.size
        framebuffer.viewport = (0, 0, self._reach * width, self._reach * height)
        framebuffer.use()
        self.program["level"] = level
        self.program["reach"] = self._reach
        self._triangle.render(moderngl.TRIANGLES, vertices=3)
        framebuffer.viewport = (0, 0, width, height)


class Readback:
    """Frames on their way from the GPU, first in, first out.

    There are as many buffers as frames were ever on their way at a time: pixel buffers of the GPU,
    or plain memory where the driver draws in that itself.
    """

    def __init__(self, resources: Resources, frame_format: FrameFormat) -> None:
        self._gl = resources.gl
        self._resources = resources
        self._format = frame_format
        width, height = frame_format.size
        # always four channels: drivers copy those as they are, and convert any other number on the
        # processor
        self._pixels = np.empty((height, width, 4), np.uint16 if frame_format.linear else np.uint8)
        self._free: list[moderngl.Buffer | NDArray] = []
        self._pending: deque[tuple[moderngl.Buffer | NDArray, int]] = deque()

    def submit(self, frame: moderngl.Framebuffer) -> None:
        """Copy a frame as soon as it is drawn; the next one may be drawn over it.

        Parameters
        ----------
        frame : moderngl.Framebuffer
            RGBA8, or RGBA16F of linear light; bottom row first, multiplied by alpha.
        """
        with self._gl:
            # which would draw the frame in the next call, holding the interpreter's lock
            if self._gl.software:
                self._gl.wait()
            if self._free:
                buffer = self._free.pop()
            elif self._gl.software:
                buffer = np.empty_like(self._pixels)
            else:
                buffer = self._resources.buffer(reserve=self._pixels.nbytes, dynamic=True)
            frame.read_into(buffer, components=4, alignment=1, dtype=self._format.dtype)
            self._pending.append((buffer, self._gl.put_fence()))

    def fetch(self) -> NDArray:
        """Wait for the earliest frame that is on its way.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a fresh array for every frame. uint8, alpha straight; or, of linear
            light, float16, multiplied by alpha.

        Raises
        ------
        RippleError
            If none is on its way.
        """
        if not self._pending:
            raise RippleError(
                "no frame is on its way from the GPU; submit one before each that is fetched"
            )
        buffer, fence = self._pending.popleft()
        self._gl.wait_for(fence)
        if isinstance(buffer, np.ndarray):
            pixels = buffer
        else:
            pixels = self._pixels
            with self._gl:
                buffer.read_into(pixels)
        frame = np.empty((*pixels.shape[:2], 4 if self._format.alpha else 3), pixels.dtype)
        # all at once would be rows of three numbers, which are slow
        for channel in range(frame.shape[2]):
            frame[..., channel] = pixels[::-1, :, channel]
        self._free.append(buffer)
        if self._format.linear:
            return frame.view(np.float16)
        if self._format.alpha:
            _unpremultiply(frame)
        return frame

    def forget(self) -> None:
        """Drop all frames that are on their way."""
        while self._pending:
            buffer, fence = self._pending.popleft()
            self._gl.wait_for(fence)
            self._free.append(buffer)


@kernel
def _unpremultiply(frame: NDArray[np.uint8]) -> None:
    """Divide the colours of a frame [height, width, 4] by alpha."""
    for row in range(frame.shape[0]):
        for column in range(frame.shape[1]):
            alpha = np.float32(max(frame[row, column, 3], 1)) / np.float32(255)
            for channel in range(3):
                color = np.float32(frame[row, column, channel]) / alpha + np.float32(0.5)
                frame[row, column, channel] = np.uint8(min(color, np.float32(255)))


class SurfaceImage(NamedTuple):
    """What is seen at the middle of each pixel, top row first.

    Attributes
    ----------
    depth : float32 [height, width]
        Distance along the camera's axis [m]; 0 where nothing is.
    geom : int32 [height, width]
        Geom id, that of the nearest geom of the body for a site; -1 where nothing is.
    identity : int32 [height, width, 2]
        Id and type, of `mujoco.mjtObj`, of what is seen; -1 where nothing is.
    normal, smooth_normal : float32 [height, width, 3]
        In the world, with ripples and without, of an open surface's outer side in the latter case.
    place : float32 [height, width, 2]
        On a target's page of charts [texels].
    target : int32 [height, width]
        Index of the target among the targets by geom id; -1: none.
    height : float32 [height, width]
        Of the ripples [m].
    """

    depth: NDArray[np.float32]
    geom: NDArray[np.int32]
    identity: NDArray[np.int32]
    normal: NDArray[np.float32]
    smooth_normal: NDArray[np.float32]
    place: NDArray[np.float32]
    target: NDArray[np.int32]
    height: NDArray[np.float32]


class SurfaceBuffers:
    """Draws surface images of one size.

    Parameters
    ----------
    size : (width, height)
        [pixels].
    """

    def __init__(self, resources: Resources, size: tuple[int, int]) -> None:
        self.size = size
        self._g_buffer = GBuffer(resources, size, 1)
        self._images = [resources.texture(size, 4, dtype="f4") for _ in range(3)]
        self._framebuffer = resources.framebuffer(self._images, resources.depth_renderbuffer(size))
        self._resolve = FramePass(resources, "passes/surface_buffers", size, SAMPLES=1)

    def draw(
        self, ctx: moderngl.Context, draw: Callable[[], None], objects: ObjectTable, floor_geom: int
    ) -> SurfaceImage:
        """Draw what `draw` draws into the G-buffer; the frame's uniforms, objects and height maps are bound already.

        `floor_geom` is the geom id of the floor, -1 without.
        """
        ctx.depth_func = "<="
        self._g_buffer.use(ctx)
        self._g_buffer.clear()
        draw()
        self._g_buffer.bind()
        self._framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        self._framebuffer.clear(depth=1.0)
        self._resolve.run(self._framebuffer, 0.0)
        width, height = self.size
        shown, smooth, rippling = (
            np.frombuffer(image.read(), np.float32).reshape(height, width, 4)[::-1]
            for image in self._images
        )
        # with nothing at 0 and the floor at the end
        number = np.rint(smooth[..., 3]).astype(np.int32)
        floor = floor_geom, int(mujoco.mjtObj.mjOBJ_GEOM)
        return SurfaceImage(
            depth=shown[..., 3],
            geom=np.array([-1, *objects.geoms, floor_geom], dtype=np.int32)[number],
            identity=np.array([(-1, -1), *objects.identities, floor], dtype=np.int32)[number],
            normal=shown[..., :3],
            smooth_normal=smooth[..., :3],
            place=rippling[..., :2],
            target=np.rint(rippling[..., 2]).astype(np.int32),
            height=rippling[..., 3],
        )
