"""Is there a display? VTK would go on without one, and show nothing to nobody."""

from __future__ import annotations

import ctypes
import os
import sys

from ripple_sim.errors import DisplayError


def check_display() -> None:
    """Make sure that a window can be opened.

    Raises
    ------
    DisplayError
        With what is missing, and what can be done instead.
    """
    problem = display_problem()
    if problem is not None:
        raise DisplayError(
            f"no window can be opened: {problem}; add --web to see it in a browser, or make a video with `ripple-sim "
            "render` or `ripple-sim drop`"
        )


def display_problem() -> str | None:
    """What keeps VTK from opening a window, or None. Wayland desktops serve X11 too, and set DISPLAY."""
    if not sys.platform.startswith("linux"):
        return None
    name = os.environ.get("DISPLAY")
    if not name:
        return "the environment variable DISPLAY is not set"
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return "the library libX11.so.6 is missing (on Debian and Ubuntu: apt-get install libx11-6)"
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return f"there is no X server at DISPLAY={name}"
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return None
