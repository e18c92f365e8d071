"""`[ripple.height]`: the shape of the surface at the beginning."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas, texture_map

from .expression import evaluate


class HeightEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[ripple.height]`: the height at the beginning: an expression, an image, or a saved field.

    Where the waves conserve the volume, the mean is removed.
    """

    expression: str | None = None
    """Height [m] as an expression of the position x, y, z in the frame of the geom's body [m], such as
    "0.02 * exp(-(x**2 + y**2) / 0.1**2)"; functions are abs, sqrt, exp, log, sin, cos, tan, atan2, hypot, minimum,
    maximum and where(condition, then, otherwise)."""
    map: str | None = None
    """Instead, path of an image in the mesh's own texture coordinates."""
    low: float = 0.0
    """Height where the image is black [m]."""
    high: float = 0.01
    """Height where it is white [m]."""
    channel: str = "luminance"
    """Part of the image that counts."""
    field: str | None = None
    """Instead, path of a .npy with one height a texel [m], [C, n, n], as `numpy.save(path, waves.height)` writes it."""

    def located(self, folder: Path) -> HeightEntry:
        """The same with its paths made relative to a folder."""
        image, field = (None if path is None else str(folder / path) for path in (self.map, self.field))
        return msgspec.structs.replace(self, map=image, field=field)

    def check(self) -> None:
        """Raise `SceneError` unless there is one shape, and the files exist."""
        given = [key for key in ("expression", "map", "field") if getattr(self, key) is not None]
        if len(given) != 1:
            raise SceneError(
                f"[ripple.height] has {' and '.join(given) or 'no shape'}; valid is one of expression, map, field"
            )
        for key in ("map", "field"):
            path = getattr(self, key)
            if path is not None and not Path(path).is_file():
                raise SceneError(f"ripple.height.{key} names the file {path!r}, which does not exist")
        if self.expression is not None:
            evaluate(self.expression, dict.fromkeys("xyz", np.ones(0)))

    def heights(self, ripples: Ripples, geom: str) -> NDArray[np.float64]:
        """Height at every texel of a geom [m], [C, n, n].

        Raises
        ------
        RippleError
            If a file cannot be read or does not suit the target, or an expression is not finite.
        """
        atlas = ripples[geom].atlas
        if self.expression is not None:
            return evaluate(self.expression, dict(zip("xyz", _places(ripples, geom), strict=True)))
        if self.map is not None:
            return texture_map(atlas, self.map, self.low, self.high, self.channel)
        return _saved(self.field or "", atlas)


def _places(ripples: Ripples, geom: str) -> NDArray[np.float64]:
    """Positions of the texels in the frame of the geom's body [m], [3, C, n, n]."""
    origin = ripples.to_geom(geom, np.zeros(3))
    axes = ripples.to_geom(geom, np.eye(3)) - origin  # of the body, as rows
    return np.moveaxis((ripples[geom].atlas.positions - origin) @ axes.T, -1, 0)


def _saved(path: str, atlas: Atlas) -> NDArray[np.float64]:
    try:
        field = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise SceneError(f"saved field {path!r} cannot be read: {error}") from error
    shape = atlas.areas.shape
    if not isinstance(field, np.ndarray) or field.shape != shape or field.dtype.kind not in "iuf":
        raise SceneError(f"saved field {path!r} holds {getattr(field, 'shape', 'no array')}; valid are numbers {shape}")
    if not np.isfinite(field).all():
        raise SceneError(f"saved field {path!r} has heights that are not finite")
    return field.astype(np.float64)
