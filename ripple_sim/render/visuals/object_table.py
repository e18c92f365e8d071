"""The table of objects: one row for each visual and target, to which the samples of the G-buffer refer."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import OBJECT, OBJECT_COLUMNS, Unit
from ripple_sim.render.resources import Resources

from .looks import Look

_ROW = OBJECT.dtype


class ObjectTable:
    """Rows of the shaders' `Object`; draw calls write the number of their row."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._rows: list[np.ndarray] = []
        self._texture: moderngl.Texture | None = None

    def add(
        self,
        look: Look,
        geom: int,
        *,
        opacity: float = 1.0,
        size: float = 1.0,
        heatmap: bool = False,
        height_map: int | None = None,
    ) -> int:
        """Append a row and return its number.

        `size` [m] is how thick a transparent object is where its relative thickness is 1; `heatmap` says that colours
        are shown as they are, but for shadows; `height_map` is the layer of the object's height map.
        """
        row = np.zeros((), dtype=_ROW)
        row["base"] = look.roughness, look.metallic, look.sheen, look.coat
        row["volume"] = look.translucency, look.transparency, look.emission, opacity
        row["place"] = geom, size, 0.0, heatmap
        row["height_map"][:2] = (0, 0) if height_map is None else (height_map, 1)
        self._rows.append(row)
        return len(self._rows) - 1

    def set_shadow_bias(self, number: int, bias: float) -> None:
        """Set how far above its surface an object's shadows are looked up [m]: its bumps shall not shade each other."""
        self._rows[number]["place"][2] = bias

    def set_occluders(self, number: int, near: int) -> None:
        """Set which occluders darken an object, as bits; see `Occluders.near`."""
        self._rows[number]["height_map"][2] = near

    def set_chart(self, number: int, side: int) -> None:
        """Set the side of a chart with its halo in an object's height map [texels]."""
        self._rows[number]["height_map"][3] = side

    def set_height_map(self, number: int, bias: float, rotation: NDArray[np.float64]) -> None:
        """Set an object's shadow bias [m], and the rotation of its height map into the world, shape [3, 3]."""
        self.set_shadow_bias(number, bias)
        self._rows[number]["rotation"][:, :3] = rotation.T  # column by column

    def bind(self) -> None:
        """Upload the rows and bind them for the shaders."""
        rows = np.zeros((max(-(-len(self._rows) // OBJECT_COLUMNS), 1), OBJECT_COLUMNS), dtype=_ROW)
        rows.ravel()[: len(self._rows)] = self._rows
        size = rows[0].nbytes // 16, len(rows)
        if self._texture is None or self._texture.size != size:
            self._texture = self._resources.texture(size, 4, dtype="f4")
            self._texture.filter = moderngl.NEAREST, moderngl.NEAREST
        self._texture.write(rows.tobytes())
        self._texture.use(Unit.OBJECTS)
