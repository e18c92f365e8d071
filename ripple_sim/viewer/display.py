"""Whether there is a display. Without one VTK would run and show nothing."""

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
        With what is missing, and the alternatives.
    """
    problem = display_problem()
    if problem is not None:
        raise DisplayError(
            f"no window can be opened: {problem}; add --web to use a browser instead, or render a video with "
            "`ripple-sim render` or `ripple-sim drop`"
        )


def display_problem() -> str | None:
    """Why VTK cannot open a window, or None. Wayland desktops serve X11 too, and set DISPLAY."""
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
