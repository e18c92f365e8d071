"""`Window`: a canvas that runs, with the user's keys, clicks and sliders; its loop on the desktop, and its speed.

`Actions` has one method for each of `CONTROLS`, and for a click.
"""

from __future__ import annotations

import ctypes
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pyvista as pv

from ripple_sim.errors import DisplayError
from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import is_software

from .canvas import CONTROLS, Canvas, add_sliders, ray
from .session import OPERATORS, Session

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


_MULTISAMPLES = 8


class Window(Canvas):
    """A session on screen or off, see `Canvas`, with its user's input.

    Attributes
    ----------
    actions : Actions
    """

    def __init__(
        self,
        session: Session,
        *,
        size: tuple[int, int] = (800, 600),
        off_screen: bool = False,
        folder: str | Path = ".",
    ) -> None:
        super().__init__(session, size=size, off_screen=off_screen, folder=folder)
        self._sliders = add_sliders(self.plotter, session)
        self._input = Input(self.plotter)
        self.actions = Actions(self, self._input)
        self._input.observe(self.key, self.actions.poke_at)
        self.plotter.iren.add_observer("RenderEvent", lambda *_: self.mark_stale())
        self.plotter.iren.add_observer("ExitEvent", lambda *_: self.actions.quit())

    @property
    def closed(self) -> bool:
        """Whether the user wants to leave."""
        return self.actions.closed

    def open(self) -> None:
        """Show the window."""
        self.plotter.show(interactive_update=True, auto_close=False, interactive=False)
        if not is_software(self.gl_renderer):
            self.plotter.render_window.SetMultiSamples(_MULTISAMPLES)
        # the loop draws, once a frame; sliders and the camera would draw at every movement of the pointer
        self.plotter.iren.interactor.EnableRenderOff()
        self.mark_stale()

    def close(self) -> None:
        """Close the window and finish a video."""
        self.actions.quit()
        try:
            self.recorder.stop()
        finally:
            self.plotter.close()

    def tick(self, draw: bool = True) -> bool:
        """Advance by one frame, and draw it if asked to; return whether there was anything new and it was drawn."""
        try:
            moved = self.session.advance()
        except RippleError as error:
            self.say(f"{error}; r: reset")
            moved = True
        if moved:
            self.update()
        if self.drawn or not draw:
            return False
        self.draw()
        return True

    @property
    def gl_renderer(self) -> str:
        """OpenGL driver of an open window, by its own name."""
        lines = self.plotter.render_window.ReportCapabilities().splitlines()
        return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("OpenGL renderer")), "none")

    def key(self, name: str) -> None:
        """Carry out the action of a key, in upper or lower case; other keys do nothing."""
        for control in CONTROLS:
            if name.lower() == control.key:
                getattr(self.actions, control.action)()


def run(window: Window) -> None:
    """Show a window until the user closes it, at most in real time."""
    window.open()
    frame = 1 / window.session.fps
    due = time.perf_counter()
    try:
        while not window.closed:
            window.plotter.iren.process_events()
            window.tick()
            due = max(due + frame, time.perf_counter() - frame)
            time.sleep(max(0.0, due - time.perf_counter()))
    finally:
        window.close()


def benchmark(window: Window, updates: int = 60, tries: int = 3) -> str:
    """Highest update rate of a window, and where the time goes: simulation, drawing, and processor time.

    The best of several runs of some updates without waiting, each with a poke and a ball at the start. Processor time
    is that of all threads, which other programs hardly change.
    """
    window.open()
    width, height = window.plotter.render_window.GetSize()
    trials = []
    for _ in range(tries):
        window.actions.reset()
        window.actions.poke_at(width // 2, height // 2)
        window.actions.throw()
        start, processor, drawing = time.perf_counter(), time.process_time(), window.seconds_drawing
        for _ in range(updates):
            window.tick()
        trials.append(
            (
                time.perf_counter() - start,
                window.seconds_drawing - drawing,
                time.process_time() - processor,
            )
        )
    renderer = window.gl_renderer
    window.close()
    seconds, drawing, processor = min(trials)
    simulate, draw, processor = (1e3 / updates * each for each in (seconds - drawing, drawing, processor))
    return (
        f"{updates / seconds:.1f} updates/s: simulation {simulate:.1f} ms, drawing {draw:.1f} ms; "
        f"{processor:.1f} ms of processor time ({renderer})"
    )


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
