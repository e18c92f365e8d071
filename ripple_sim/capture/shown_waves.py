"""`ShownWaves` warns of waves that no picture shows: rings that are too low, or no waves at all."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse, Ripples
from ripple_sim.render.pose import Pose
from ripple_sim.solver.backends.gl_fields import DeviceField
from ripple_sim.solver.errors import warn_caller

from .snapshot import Field, Heights

# Height of waves that catch the eye [pixels].
_VISIBLE_HEIGHT = 5.0

# Least distance of the camera from a target's surface, over its distance from what it looks at: a
# camera within the target's bounding sphere looks at a surface all the same.
_MIN_DISTANCE_SHARE = 0.1

# The dent under a body is no ring: this far from the place of a touch, over the target's size, and
# for so long after it [s], heights do not count.
_DENT_SHARE = 0.12
_DENT_TIME = 0.1


class _Height(NamedTuple):
    """A height in a picture.

    Attributes
    ----------
    pixels : float
        [pixels]
    metres : float
        [m]
    pixel_width : float
        Width of a pixel there [m].
    """

    pixels: float = 0.0
    metres: float = 0.0
    pixel_width: float = 1.0


@dataclasses.dataclass
class _Record:
    """What was seen of a target.

    Attributes
    ----------
    highest, crest : _Height
        Of all its waves, and of those outside the dents under bodies.
    settled : bool
        Whether a picture showed waves when no touch was recent.
    touches : list of (float, float64 [3])
        Times [s] and places of the latest touches, in the frame of the geom [m].
    """

    highest: _Height = dataclasses.field(default_factory=_Height)
    crest: _Height = dataclasses.field(default_factory=_Height)
    settled: bool = False
    touches: list[tuple[float, NDArray[np.float64]]] = dataclasses.field(default_factory=list)

    def judged(self) -> _Height:
        """The height by which the waves are judged: of the ring, once the bodies have left."""
        return self.crest if self.settled else self.highest


class ShownWaves:
    """Records how high rings are in pictures, and warns of waves that no picture shows.

    Parameters
    ----------
    ripples : Ripples
    height : int
        Of the pictures [pixels].
    """

    def __init__(self, ripples: Ripples, height: int) -> None:
        self._ripples = ripples
        self._height = height
        self._records = {name: _Record() for name in ripples}

    def look(
        self, data: mujoco.MjData, heights: Heights, pose: Pose, impulses: Iterable[Impulse]
    ) -> None:
        """Record the highest rings of a picture from a pose.

        Their height in pixels is that at the nearest point of the target that may be seen.
        `impulses` are those since the picture before.
        """
        for impulse in impulses:
            if impulse.geom in self._records:
                place = self._ripples[impulse.geom].rest.positions[impulse.texel]
                self._records[impulse.geom].touches.append((data.time, place))
        for name, height in heights.items():
            record = self._records[name]
            record.touches = [
                (time, place)
                for time, place in record.touches
                if 0 <= data.time - time <= _DENT_TIME
            ]
            if record.crest.pixels < 1:
                self._measure(name, record, height, self._pixel_width(name, data, pose))

    def _pixel_width(self, name: str, data: mujoco.MjData, pose: Pose) -> float:
        """Width of a pixel at the nearest point of a target [m]."""
        model = self._ripples.model
        geom = self._ripples.geom_ids[name]
        distance = pose.distance
        if geom < model.ngeom:  # a soft target has no position
            to_middle = float(np.linalg.norm(data.geom_xpos[geom] - pose.position))
            to_surface = to_middle - float(model.geom_rbound[geom])
            distance = max(to_surface, _MIN_DISTANCE_SHARE * distance)
        return pose.pixel_height(distance, self._height)

    def _measure(self, name: str, record: _Record, height: Field, pixel_width: float) -> None:
        """Raise a target's record to its highest wave and its highest ring.

        `pixel_width` is the width of a pixel at the target [m].
        """
        peak = height.peak if isinstance(height, DeviceField) else float(np.abs(height).max())
        record.highest = max(record.highest, _Height(peak / pixel_width, peak, pixel_width))
        record.settled |= peak > 0 and not record.touches
        # heights on a GPU are read back only where they may raise the record
        if record.touches and peak / pixel_width > record.crest.pixels:
            peak = self._peak_of_rings(name, record, np.asarray(height))
        record.crest = max(record.crest, _Height(peak / pixel_width, peak, pixel_width))

    def _peak_of_rings(self, name: str, record: _Record, height: NDArray[np.float32]) -> float:
        """Highest wave of a target outside the dents of the latest touches [m]."""
        rest = self._ripples[name].rest
        size = float(np.ptp(rest.mesh.V, axis=0).max())
        outside = np.ones(height.shape, np.bool_)
        for _, place in record.touches:
            outside &= np.linalg.norm(rest.positions - place, axis=-1) > _DENT_SHARE * size
        return float(np.abs(height).max(where=outside, initial=0.0))

    def warn_of_low(self, silent: Collection[str] = ()) -> None:
        """Warn of targets whose rings were never higher than a pixel; name a density that helps.

        There is no warning of targets without waves, nor of `silent` ones.
        """
        for name, record in self._records.items():
            judged = record.judged()
            if 0 < judged.pixels < 1 and name not in silent:
                density = np.asarray(self._ripples[name].material.density)
                factor = _VISIBLE_HEIGHT / judged.pixels
                lower = "" if density.ndim else f", {float(density) / factor:.2g} kg/m^2,"
                warn_caller(
                    f"no wave on {name!r} was higher than a pixel: {judged.metres:.2g} m at most, "
                    f"where a pixel is {judged.pixel_width:.2g} m wide. A density {factor:.2g} "
                    f"times lower{lower} would show {_VISIBLE_HEIGHT:g} pixels; so may material = "
                    '{preset = "suited"} in a scene file, Material.suited(size, hit) in Python'
                )

    def warn_of_none(self) -> None:
        """Warn of targets without any wave."""
        for name, record in self._records.items():
            if record.highest.pixels == 0:
                warn_caller(
                    f"there was no wave on {name!r}: nothing touched it. Drop or throw a body on "
                    "it, or poke it, in a scene file by [[drop]], [[throw]] or [[poke]]; or let a "
                    "geom ripple that is touched"
                )
