"""The table of all that is drawn: one row an object, which every pixel of the geometry pass refers to."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.looks import Look

from .resources import OwnedObjects

_ROW = np.dtype(
    [("base", "f4", 4), ("volume", "f4", 4), ("place", "f4", 4), ("height_map", "f4", 4), ("rotation", "f4", (3, 4))]
)


class ObjectTable:
    """Rows of the shaders' `Object`; the row's number is what a draw call writes."""

    def __init__(self, ctx: OwnedObjects) -> None:
        self._ctx = ctx
        self._rows: list[np.ndarray] = []
        self._buffer: moderngl.Buffer | None = None

    def add(
        self,
        look: Look,
        geom: int,
        *,
        opacity: float = 1.0,
        size: float = 1.0,
        painted: bool = False,
        height_map: tuple[int, int] = (0, 0),
    ) -> int:
        """Append a row and return its number.

        `size` [m] scales the way through clear bodies; `height_map` gives the first layer of an object's height map and
        the texels along an edge of its faces, 0 without one.
        """
        row = np.zeros((), dtype=_ROW)
        row["base"] = look.roughness, look.metallic, look.sheen, look.coat
        row["volume"] = look.translucency, look.transparency, look.emission, opacity
        row["place"] = geom, size, 0.0, painted
        row["height_map"][:2] = height_map
        self._rows.append(row)
        return len(self._rows) - 1

    def set_lift(self, number: int, lift: float) -> None:
        """Set how high an object's bumps or edges stand off it [m]: they shall not shade each other."""
        self._rows[number]["place"][2] = lift

    def set_height_map(self, number: int, lift: float, rotation: NDArray[np.float64]) -> None:
        """Set the height of an object's highest bump [m], and the rotation of its height map into the world."""
        self.set_lift(number, lift)
        self._rows[number]["rotation"][:, :3] = rotation.T  # column by column

    def bind(self) -> None:
        """Upload the rows and bind them for the shaders."""
        data = np.array(self._rows, dtype=_ROW).tobytes() or bytes(_ROW.itemsize)
        if self._buffer is None or self._buffer.size != len(data):
            self._buffer = self._ctx.buffer(reserve=len(data), dynamic=True)
        self._buffer.write(data)
        self._buffer.bind_to_storage_buffer(5)
