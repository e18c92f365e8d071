"""Overlays by name: "height", "velocity=0.5", "contacts" and so on."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

from ripple_sim.errors import SceneError

HEATMAPS = {"height": "m", "velocity": "m/s"}
NAMES = (*HEATMAPS, "contacts", "grid", "time", "energy")


@dataclasses.dataclass(frozen=True)
class Request:
    """Overlays to draw.

    Attributes
    ----------
    heatmap : str or None
        "height" or "velocity": shown as colours on the targets, with a colour bar.
    limit : float or None
        End of the colours, in m or m/s; None: adapts to the waves during the video.
    contacts, grid, time, energy : bool
        Arrows of the impulses at the contact points; the texel grid; a clock; a plot of the waves' energy.
    """

    heatmap: str | None = None
    limit: float | None = None
    contacts: bool = False
    grid: bool = False
    time: bool = False
    energy: bool = False

    def __bool__(self) -> bool:
        return self != Request()


def parse_request(words: Iterable[str]) -> Request:
    """Read names of overlays; "height" and "velocity" may have a range, such as "height=0.02" [m, m/s].

    Raises
    ------
    SceneError
        For an unknown name, a range that is not a positive number or of an overlay without range, or two heatmaps.
    """
    chosen: dict[str, float | None] = {}
    for word in words:
        name, given, value = word.strip().partition("=")
        if name not in NAMES:
            raise SceneError(f"there is no overlay {name!r}; valid are {', '.join(NAMES)}")
        if given and name not in HEATMAPS:
            raise SceneError(f"overlay {word.strip()!r}: {name} has no range; only {' and '.join(HEATMAPS)} have one")
        chosen[name] = _positive(word, value, HEATMAPS[name]) if given else None
    heatmaps = [name for name in HEATMAPS if name in chosen]
    if len(heatmaps) > 1:
        raise SceneError(f"overlays {' and '.join(heatmaps)} cannot both colour the surface; choose one")
    return Request(
        heatmap=heatmaps[0] if heatmaps else None,
        limit=chosen[heatmaps[0]] if heatmaps else None,
        **{name: name in chosen for name in NAMES if name not in HEATMAPS},
    )


def _positive(word: str, value: str, unit: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not (number > 0 and math.isfinite(number)):
        raise SceneError(f"overlay {word.strip()!r}: the range must be a positive number [{unit}]")
    return number
