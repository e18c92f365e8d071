"""Overlays of a video by name, such as "velocity=0.5"."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterable

from ripple_sim.errors import SceneError

# Overlays that colour the surface, with the unit of their range.
HEATMAPS = {"height": "m", "velocity": "m/s"}

# Names of all overlays.
NAMES = (*HEATMAPS, "contacts", "grid", "time", "energy", "sensors")


@dataclasses.dataclass(frozen=True)
class Request:
    """Overlays to draw.

    Attributes
    ----------
    heatmap : str or None
        "height" or "velocity": shown as colours on the targets, with a colour bar.
    limit : float or None
        End of the colours [m or m/s]; None: the colours adapt to the waves during the video.
    contacts, grid, time, energy, sensors : bool
        Arrows of the impulses at the contact points; the texel grid; a clock; a plot of the waves'
        energy, with that of bodies and both; the traces of the scene's sensors.
    """

    heatmap: str | None = None
    limit: float | None = None
    contacts: bool = False
    grid: bool = False
    time: bool = False
    energy: bool = False
    sensors: bool = False


def parse_request(words: Iterable[str]) -> Request:
    """Read names of overlays.

    "height" [m] and "velocity" [m/s] may have a range, such as "height=0.02". Raises `SceneError`
    for an unknown name, a range that is not a positive number, a range of an overlay that has none,
    or two heatmaps.
    """
    ranges: dict[str, float | None] = {}
    for word in words:
        name, equals_sign, value = word.strip().partition("=")
        if name not in NAMES:
            raise SceneError(f"there is no overlay {name!r}; overlays are {', '.join(NAMES)}")
        if equals_sign and name not in HEATMAPS:
            raise SceneError(
                f"overlay {word.strip()!r}: {name} has no range; only {' and '.join(HEATMAPS)} "
                "have one"
            )
        ranges[name] = None
        if equals_sign:
            limit = math.nan
            with contextlib.suppress(ValueError):
                limit = float(value)
            if not 0 < limit < math.inf:
                raise SceneError(
                    f"overlay {word.strip()!r}: the range must be a positive number "
                    f"[{HEATMAPS[name]}]"
                )
            ranges[name] = limit
    heatmaps = [name for name in HEATMAPS if name in ranges]
    if len(heatmaps) > 1:
        raise SceneError(
            f"overlays {' and '.join(heatmaps)} cannot both colour the surface; choose one"
        )
    return Request(
        heatmap=heatmaps[0] if heatmaps else None,
        limit=ranges[heatmaps[0]] if heatmaps else None,
        **{name: name in ranges for name in NAMES if name not in HEATMAPS},
    )
