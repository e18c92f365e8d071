"""The G-buffer: depths, normals and colours of the nearest surfaces, before they are lit."""

from __future__ import annotations

import moderngl

from .contract import Unit
from .resources import Resources


class GBuffer:
    """Depths, normals and colours; g_buffer.glsl encodes them.

    Parameters
    ----------
    size : (width, height)
        Width and height [pixels].
    samples : int
        Samples a pixel; at most as many as the driver has.

    Attributes
    ----------
    samples : int
        Samples a pixel, 1 or more.
    """

    def __init__(self, resources: Resources, size: tuple[int, int], samples: int) -> None:
        with resources.gl as ctx:
            samples = min(samples, ctx.max_samples)
        self.samples = max(samples, 1)
        texture_samples = samples if samples > 1 else 0  # 0: no multisampling
        depths = resources.depth_texture(size, samples=texture_samples)
        normals = resources.texture(size, 4, samples=texture_samples, dtype="nu2")
        colors = resources.texture(size, 4, samples=texture_samples, dtype="nu2")
        self._textures = {Unit.DEPTHS: depths, Unit.NORMALS: normals, Unit.COLORS: colors}
        if texture_samples == 0:
            depths.compare_func = ""
            for texture in self._textures.values():
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._framebuffer = resources.framebuffer([normals, colors], depths)

    def use(self, ctx: moderngl.Context) -> None:
        """Draw into the G-buffer from now on."""
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
