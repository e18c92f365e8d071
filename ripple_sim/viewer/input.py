"""Keys and clicks of a plotter, as calls."""

from __future__ import annotations

from collections.abc import Callable

import pyvista as pv

# A click that moves the pointer farther than this turns the camera and pokes nothing [pixels].
_STILL = 4


class Input:
    """The pointer and the keyboard of a plotter's window.

    Parameters
    ----------
    plotter : pyvista.Plotter
    """

    def __init__(self, plotter: pv.Plotter) -> None:
        self._iren = plotter.iren
        self._pressed: tuple[int, int] | None = None

    def observe(self, on_key: Callable[[str], object], on_click: Callable[[int, int], object]) -> None:
        """Call `on_key` with each key's name, and `on_click` with the pixel, from the lower left, of each click."""
        iren = self._iren
        iren.clear_key_event_callbacks()
        # keys are ours: the style's own ones end the program, draw wire frames and the like
        iren.style.AddObserver("CharEvent", lambda *_: None)
        iren.add_observer("KeyPressEvent", lambda *_: on_key(iren.interactor.GetKeySym()))
        iren.add_observer("LeftButtonPressEvent", lambda *_: self._press())
        iren.add_observer("LeftButtonReleaseEvent", lambda *_: self._release(on_click))

    def place(self) -> tuple[int, int] | None:
        """Pixel under the pointer, from the lower left; None if it has never been over the window."""
        x, y = self._iren.get_event_position()
        return None if (x, y) == (0, 0) else (x, y)

    def _press(self) -> None:
        self._pressed = self._iren.get_event_position()

    def _release(self, on_click: Callable[[int, int], object]) -> None:
        pressed, self._pressed = self._pressed, None
        x, y = self._iren.get_event_position()
        if pressed is not None and max(abs(x - pressed[0]), abs(y - pressed[1])) <= _STILL:
            on_click(x, y)
