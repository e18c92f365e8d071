"""Objects on the GPU that are released together."""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Iterator
from typing import Any

import moderngl

from ripple_sim.solver.gl import GLContext

from .contract import DEFINES

# Package in which programs are looked up by path.
_PACKAGE = "ripple_sim.render"


class Resources:
    """Creates objects on the GPU and releases all of them at once.

    They are released at the latest when their owner is garbage collected. `Resources` has the
    methods of `moderngl.Context` that create objects (`buffer`, `texture`, ...).

    Parameters
    ----------
    owner : object
        The object that uses the created objects.

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
        """Program of one of the renderer's GLSL files, by its path.

        `options` are defines in addition to `contract.DEFINES`. For `captured` see
        `GLContext.program`.
        """
        defines = {"HOLD_UNIFORMS": int(self.gl.software), **DEFINES, **options}
        return self._own(self.gl.program(_PACKAGE, name, *captured, **defines))

    def compute_shader(
        self, name: str, stage: str = "compute", **options: object
    ) -> moderngl.ComputeShader:
        """Compute shader of one of the renderer's GLSL files, by its path; it is shared."""
        return self.gl.compute_shader(_PACKAGE, name, stage, **DEFINES, **options)

    def clamped_texture(
        self, size: tuple[int, ...], components: int, *, mipmaps: bool = False, **options: Any
    ) -> Any:
        """Texture (width, height) or texture array (width, height, layers) that does not repeat.

        Texels are interpolated linearly, and mipmaps too.
        """
        create = self.texture if len(size) == 2 else self.texture_array
        texture = create(size, components, **options)
        texture.repeat_x = False
        texture.repeat_y = False
        minified = moderngl.LINEAR_MIPMAP_LINEAR if mipmaps else moderngl.LINEAR
        texture.filter = (minified, moderngl.LINEAR)
        return texture

    def release(self) -> None:
        """Release everything, now or when the context is entered next.

        A second call does nothing.
        """
        self._finalizer()
        self.gl.free()

    @contextlib.contextmanager
    def drawing(self) -> Iterator[None]:
        """Context in which a frame is drawn.

        If drawing is interrupted, by Ctrl-C for instance, the framebuffers are reset, so that the
        next frame begins like the first.
        """
        try:
            yield
        except BaseException:
            self._reset_framebuffers()
            raise

    def _reset_framebuffers(self) -> None:
        """Reset the state that passes change: masks, scissors, viewports and winding."""
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
