"""Maps of what transparent objects take from the lights."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import moderngl

from ripple_sim.render.contract import Unit
from ripple_sim.render.resources import Resources

Matrix = tuple[float, ...]


class TransmissionMaps:
    """Square maps in colour, side by side, of the transparent objects of a scene as the lights see them.

    Parameters
    ----------
    resources : Resources
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    size : int
        Texels along a side.
    """

    def __init__(self, resources: Resources, count: int, size: int) -> None:
        self._size = size
        self._maps = resources.texture((count * size, size), 4, dtype="f2")
        self._maps.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._maps.repeat_x = self._maps.repeat_y = False
        self._target = resources.framebuffer([self._maps], resources.depth_renderbuffer((count * size, size)))

    def draw(self, views: Sequence[Matrix], draw: Callable[[Matrix, int], None]) -> None:
        """Draw all maps; `draw` draws what is transparent under a matrix of 16 numbers, for a light."""
        self._target.viewport = (0, 0, *self._target.size)
        self._target.use()
        self._target.clear(depth=1.0)
        for light, view in enumerate(views):
            self._target.viewport = (light * self._size, 0, self._size, self._size)
            draw(view, light)
        self._maps.build_mipmaps()

    def bind(self) -> None:
        """Bind the maps for the shaders."""
        self._maps.use(Unit.TRANSMISSION)
