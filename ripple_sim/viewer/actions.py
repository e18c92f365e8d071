"""What the user can do in the viewer: one method for each of `CONTROLS`, and for a click."""

from __future__ import annotations

from ripple_sim.solver import RippleError

from .canvas import Canvas
from .input import Input
from .orbit import ray
from .session import OPERATORS


class Actions:
    """The actions on a canvas.

    Attributes
    ----------
    closed : bool
        Whether the user wants to leave.
    """

    def __init__(self, canvas: Canvas, pointer: Input) -> None:
        self._canvas, self._pointer, self._session = canvas, pointer, canvas.session
        self.closed = False

    def pause(self) -> None:
        """Pause, or resume."""
        self._session.paused = not self._session.paused
        self._canvas.say("")

    def step(self) -> None:
        """Advance by one frame and pause."""
        self._session.paused = True
        try:
            self._session.step()
        except RippleError as error:
            self._canvas.say(f"{error}; r: reset")
        self._canvas.update()

    def reset(self) -> None:
        """Start again."""
        self._session.reset()
        self._canvas.say("")
        self._canvas.update()

    def poke_at(self, x: int, y: int) -> bool:
        """Poke the surface under a pixel, counted from the lower left; return whether there is a rippling one."""
        return self._session.poke(*ray(self._canvas.plotter.renderer, x, y)) is not None

    def throw(self) -> None:
        """Throw a ball from the camera at the pointer, or at the middle if that has never been over the window."""
        width, height = self._canvas.size()
        x, y = self._pointer.place() or (width // 2, height // 2)
        if not self._session.throw(*ray(self._canvas.plotter.renderer, x, y)):
            self._canvas.say("this scene has no ball to throw")

    def operator(self) -> None:
        """Switch to the next wave operator."""
        following = OPERATORS[(OPERATORS.index(self._session.operator) + 1) % len(OPERATORS)]
        self._session.set_operator(following)
        self._canvas.say("")

    def colors(self) -> None:
        """Show the height as colours, or the surface in its own."""
        self._canvas.stage.toggle_heatmap()
        self._canvas.mark_stale()

    def screenshot(self) -> None:
        """Write an image."""
        self._canvas.draw()
        try:
            self._canvas.say(f"wrote {self._canvas.recorder.save(self._canvas.pixels())}")
        except RippleError as error:
            self._canvas.say(str(error))

    def record(self) -> None:
        """Begin a video, or end it."""
        recorder = self._canvas.recorder
        try:
            if recorder.recording:
                self._canvas.say(f"wrote {recorder.stop()}")
            else:
                self._canvas.say(f"recording {recorder.start(self._canvas.pixels())}")
        except RippleError as error:
            self._canvas.say(str(error))

    def help(self) -> None:
        """Show or hide the list of keys."""
        self._canvas.toggle_help()

    def quit(self) -> None:
        """Leave."""
        self.closed = True
