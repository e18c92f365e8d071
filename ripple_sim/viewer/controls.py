"""What can be done in the viewer, and by which key: for the window, the web page and the help texts alike."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True)
class Control:
    """A key, the method of `Actions` that it calls, and what that does, in few words."""

    key: str
    action: str
    label: str


CONTROLS = (
    Control("space", "pause", "pause, go on"),
    Control("n", "step", "next frame"),
    Control("r", "reset", "reset"),
    Control("t", "throw", "throw a ball"),
    Control("o", "operator", "operator"),
    Control("c", "colors", "height as colours"),
    Control("s", "screenshot", "screenshot"),
    Control("v", "record", "record, stop"),
    Control("h", "help", "keys on, off"),
    Control("q", "quit", "quit"),
)

MOUSE = (("click", "poke"), ("drag", "orbit"), ("shift + drag", "pan"), ("wheel", "zoom"))


def help_text() -> str:
    """All of them, one a line."""
    rows = [*MOUSE, *((control.key, control.label) for control in CONTROLS)]
    return "\n".join(f"{what}: {does}" for what, does in rows)
