"""Objects on the GPU that are released together."""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Iterator
from typing import Any

import moderngl

from ripple_sim.solver.gl import GLContext

from .contract import DEFINES

_PACKAGE = "ripple_sim.render"


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
