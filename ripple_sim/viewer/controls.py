"""The viewer's controls and their keys, for the window, the web page and the help texts alike."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Control:
    """A key, the method of `Actions` that it calls, and a short label."""

    key: str
    action: str
    label: str


CONTROLS = (
    Control("space", "pause", "pause, resume"),
    Control("n", "step", "next frame"),
    Control("r", "reset", "reset"),
    Control("t", "throw", "throw a ball"),
    Control("o", "operator", "operator"),
    Control("c", "colors", "heatmap on, off"),
    Control("s", "screenshot", "screenshot"),
    Control("v", "record", "record, stop"),
    Control("h", "help", "keys on, off"),
    Control("q", "quit", "quit"),
)

MOUSE = (("click", "poke"), ("drag", "orbit"), ("shift + drag", "pan"), ("wheel", "zoom"))


def help_text() -> str:
    """All controls, one per line."""
    rows = [*MOUSE, *((control.key, control.label) for control in CONTROLS)]
    return "\n".join(f"{what}: {does}" for what, does in rows)
