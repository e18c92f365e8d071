"""Objects on the GPU that are released together, and those that every pass shares.

These are the uniform block of a frame, textures of sRGB pixels, which read as linear light, and the
height maps of all targets.
"""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.texels.chart_page import ChartPage
from ripple_sim.solver.waves.height_map import DeviceHeightMap

from .camera import Pose, view_matrix
from .contract import DEFINES, FRAME, Binding, Unit

_PACKAGE = "ripple_sim.render"

SRGB8_ALPHA8 = 0x8C43


class Resources:
    """Creates objects on the GPU and releases all of them at once, at the latest when their owner is collected.

    It has the methods of `moderngl.Context` that create something (`buffer`, `texture`, ...).

    Parameters
    ----------
    owner : object
        Whoever uses the objects.

    Attributes
    ----------
    gl : GLContext
    """

    def __init__(self, gl: GLContext, owner: object) -> None:
        self.gl = gl
        self._created: list[Any] = []
        self._finalizer = weakref.finalize(owner, gl.discard, self._created)
        self._finalizer.atexit = False

    def __getattr__(self, name: str) -> Any:
        def create(*arguments: Any, **options: Any) -> Any:
            with self.gl as ctx:
                return self._own(getattr(ctx, name)(*arguments, **options))

        return create

    def program(self, name: str, *captured: str, **options: object) -> moderngl.Program:
        """Program of one of the renderer's files, by its path; `options` are defines beside the contract.

        For `captured` see `GLContext.program`.
        """
        defines = {"HOLD_UNIFORMS": int(self.gl.software), **DEFINES, **options}
        return self._own(self.gl.program(_PACKAGE, name, *captured, **defines))

    def compute_shader(
        self, name: str, stage: str = "compute", **options: object
    ) -> moderngl.ComputeShader:
        """One of the renderer's compute shaders, likewise; it is shared."""
        return self.gl.compute_shader(_PACKAGE, name, stage, **DEFINES, **options)

    def clamped_texture(
        self, size: tuple[int, ...], components: int, *, mipmaps: bool = False, **options: Any
    ) -> Any:
        """Texture (width, height), or array of them with a number of layers, that does not repeat.

        It is read linearly, over its mipmaps too where it has some.
        """
        texture = (self.texture if len(size) == 2 else self.texture_array)(
            size, components, **options
        )
        texture.repeat_x = texture.repeat_y = False
        texture.filter = (
            moderngl.LINEAR_MIPMAP_LINEAR if mipmaps else moderngl.LINEAR,
            moderngl.LINEAR,
        )
        return texture

    def release(self) -> None:
        """Release everything, at once or when the context is next entered; a second time does nothing."""
        self._finalizer()
        self.gl.free()

    @contextlib.contextmanager
    def drawing(self) -> Iterator[None]:
        """A frame: if it is interrupted, by Ctrl-C for instance, the next one begins like the first."""
        try:
            yield
        except BaseException:
            self._reset_framebuffers()
            raise

    def _reset_framebuffers(self) -> None:
        """Undo what passes set for a while: masks, scissors, viewports, and the reflection's winding."""
        all_channels = (True, True, True, True)
        with self.gl as ctx:
            ctx.front_face = "ccw"
            for created in self._created:
                if isinstance(created, moderngl.Framebuffer):
                    framebuffer: Any = created  # moderngl's own hints say less than it takes
                    count = len(framebuffer.color_attachments)
                    framebuffer.color_mask = all_channels if count == 1 else [all_channels] * count
                    framebuffer.depth_mask = True
                    framebuffer.scissor = None
                    framebuffer.viewport = (0, 0, *framebuffer.size)

    def _own(self, created: Any) -> Any:
        self._created.append(created)
        return created


class FrameUniforms:
    """The block's values and its buffer.

    Attributes
    ----------
    values : structured array, shape []
        Of the dtype of `contract.FRAME`.
    """

    def __init__(self, resources: Resources) -> None:
        self.values = np.zeros((), dtype=FRAME.dtype)
        self.set_vector("floor_map", [0.0, 0.0, 1.0])
        self._buffer = resources.buffer(reserve=FRAME.dtype.itemsize, dynamic=True)

    def set_vector(self, name: str, xyz: Any, w: float = 0.0) -> None:
        """Set a vec4 from three numbers and one."""
        self.values[name][:3] = xyz
        self.values[name][3] = w

    def set_camera(
        self, pose: Pose, aspect: float, balls: NDArray[np.float64] | None = None
    ) -> None:
        """Set whatever depends on the camera; `aspect` is width over height, and the `balls` contain all solids."""
        near, far = planes = pose.clip_planes if balls is None else pose.planes_about(balls)
        half_width, half_height = pose.half_sizes(aspect)
        matrix = pose.projection(aspect, planes) @ view_matrix(pose)
        self.values["view_projection"] = matrix.T  # column by column
        self.set_vector("eye", pose.eye, pose.distance)
        self.set_vector("focus", pose.focus, 0.0 if pose.clip is None else pose.clip[0])
        self.set_vector("ray", pose.rotation @ [*pose.shear, -1.0], near)
        self.set_vector("ray_right", half_width * pose.rotation[:, 0], far)
        self.set_vector("ray_up", half_height * pose.rotation[:, 1], float(pose.orthographic))

    def bind(self) -> None:
        """Upload the values and bind the block for all programs."""
        self._buffer.write(self.values.tobytes())
        self._buffer.bind_to_uniform_block(Binding.FRAME)


def srgb_texture(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """Repeating texture with mipmaps, of pixels [height, width, 3], the first row at v = 0.

    Where the driver takes none as large it is scaled down, with a warning.
    """
    size, opaque = _flat_texels(resources, pixels)
    return _trilinear(resources.texture(size, 4, opaque, internal_format=SRGB8_ALPHA8))


def srgb_cube(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.TextureCube:
    """Cube map with mipmaps, of pixels [6 size, size, 3]: its faces below one another, or one image for all of them."""
    size, opaque = _cube_texels(resources, pixels)
    return _trilinear(resources.texture_cube((size, size), 4, opaque, internal_format=SRGB8_ALPHA8))


def write_srgb(
    resources: Resources,
    texture: moderngl.Texture | moderngl.TextureCube,
    pixels: NDArray[np.uint8],
) -> None:
    """Replace the pixels of a texture of `srgb_texture` or `srgb_cube` by others of the same shape."""
    if isinstance(texture, moderngl.TextureCube):
        size, opaque = _cube_texels(resources, pixels)
        face = 4 * size * size
        for index in range(6):
            texture.write(index, opaque[index * face : (index + 1) * face])
    else:
        texture.write(_flat_texels(resources, pixels)[1])
    texture.build_mipmaps()


def _flat_texels(resources: Resources, pixels: NDArray[np.uint8]) -> tuple[tuple[int, int], bytes]:
    """Width and height of a flat texture, and its RGBA texels."""
    with resources.gl as ctx:
        pixels = fitted(pixels, ctx.info["GL_MAX_TEXTURE_SIZE"])
    height, width, _ = pixels.shape
    return (width, height), Image.fromarray(pixels).convert("RGBA").tobytes()


def _cube_texels(resources: Resources, pixels: NDArray[np.uint8]) -> tuple[int, bytes]:
    """Side of a cube map, and the RGBA texels of its faces, one after another."""
    if len(pixels) != 6 * pixels.shape[1]:
        pixels = np.concatenate([pixels[: pixels.shape[1]]] * 6)
    with resources.gl as ctx:
        faces = [
            fitted(face, ctx.info["GL_MAX_CUBE_MAP_TEXTURE_SIZE"]) for face in np.split(pixels, 6)
        ]
    return faces[0].shape[1], Image.fromarray(np.concatenate(faces)).convert("RGBA").tobytes()


def fitted(pixels: NDArray[np.uint8], largest: int) -> NDArray[np.uint8]:
    """Pixels [height, width, 3] scaled down so that neither side is longer than `largest`."""
    height, width, _ = pixels.shape
    if max(height, width) <= largest:
        return pixels
    scale = largest / max(height, width)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    warn_caller(
        f"a texture of {width}x{height} pixels is larger than the {largest} that the OpenGL driver "
        f"takes: it is scaled "
        f"down to {size[0]}x{size[1]}"
    )
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))


def _trilinear(texture: Any) -> Any:
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture


class MovedHeightMap(NamedTuple):
    """Height map of a surface that has moved.

    Attributes
    ----------
    height_map : float32 [C, n + 2, n + 2, 4]
        Its gradients are those on the moved surface; see `MovedGradients`.
    V : float64 [vertex_count, 3]
        Where the vertices of the target's mesh are, in its frame [m].
    """

    height_map: NDArray[np.float32]
    V: NDArray[np.float64]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        return np.asarray(self.height_map, dtype=dtype)


# in the host's memory, or on the GPU, where it is made
AnyHeightMap: TypeAlias = NDArray[np.float32] | DeviceHeightMap | MovedHeightMap


class HeightMapTextures:
    """A texture array with one layer a target: a page of its charts.

    Layers are as large as the largest page.

    Parameters
    ----------
    pages : sequence of ChartPage
        Of the targets.
    """

    def __init__(self, resources: Resources, pages: Sequence[ChartPage]) -> None:
        self._pages = pages
        width, height = (max((page.size[axis] for page in pages), default=1) for axis in range(2))
        self._texture = resources.clamped_texture(
            (width, height, max(len(pages), 1)), 4, dtype="f4"
        )

    def write(self, layer: int, height_map: NDArray[np.float32] | DeviceHeightMap) -> float:
        """Replace a target's height map, [C, n + 2, n + 2, 4]; return the largest height in it [m]."""
        if isinstance(height_map, DeviceHeightMap):
            return height_map.fill(self._texture, layer)
        write_page(self._texture, self._pages[layer], layer, height_map)
        return float(np.abs(height_map[..., 3]).max())

    def bind(self) -> None:
        """Bind the texture for the shaders."""
        self._texture.use(Unit.HEIGHT_MAPS)


def write_page(
    texture: moderngl.TextureArray, page: ChartPage, layer: int, charts: NDArray[np.float32]
) -> None:
    """Write charts with halo, [C, n + 2, n + 2, ...], to the page in a layer of a texture array."""
    for first in range(0, len(charts), page.columns):
        # a row of charts at once: each write has its price
        row = np.ascontiguousarray(
            np.concatenate(charts[first : first + page.columns], axis=1), dtype=np.float32
        )
        x, y = page.corner(first)
        texture.write(row, viewport=(x, y, layer, row.shape[1], page.block, 1))
