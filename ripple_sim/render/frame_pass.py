"""A fragment shader that runs over a whole framebuffer."""

from __future__ import annotations

import moderngl

from .resources import Resources


class FramePass:
    """A fragment shader that runs over all pixels of a framebuffer that pass the depth test.

    Parameters
    ----------
    name : str
        Path of the shader.
    size : (width, height)
        Size of the framebuffer [pixels].
    **options
        Defines of the shader.

    Attributes
    ----------
    program : moderngl.Program
    """

    def __init__(
        self, resources: Resources, name: str, size: tuple[int, int], **options: object
    ) -> None:
        with resources.gl as ctx:
            widest = min(ctx.info["GL_MAX_VIEWPORT_DIMS"])
        # The triangle over the frame lies within a viewport twice as large as the frame. A driver
        # that clips it would cut it in two, and derivatives along the cut would be undefined.
        self._reach = 2 if 2 * max(size) <= widest else 1
        self.program = resources.program(name, **options, TILES=0)
        self._triangle = resources.vertex_array(self.program, [])

    def run(self, framebuffer: moderngl.Framebuffer, level: float) -> None:
        """Run over a framebuffer; `level` is the depth for the depth test."""
        width, height = framebuffer.size
        framebuffer.viewport = (0, 0, self._reach * width, self._reach * height)
        framebuffer.use()
        self.program["level"] = level
        self.program["reach"] = self._reach
        self._triangle.render(moderngl.TRIANGLES, vertices=3)
        framebuffer.viewport = (0, 0, width, height)
