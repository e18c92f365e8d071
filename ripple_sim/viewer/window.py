"""`Window`: a drawn session with its keys, clicks and sliders; `run` and `benchmark`.

It has one method for each of `CONTROLS`, and for a click.
"""

from __future__ import annotations

import math
import time
import weakref
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkUnsignedCharArray

from ripple_sim.encode.output import check_size
from ripple_sim.errors import DisplayError
from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import is_software

from .controls import CONTROLS, add_sliders, help_text, level, ray
from .opening import display_problem
from .recorder import Recorder
from .session import OPERATORS, Session
from .stage import Stage

# [pixels]: a click that moves the pointer farther turns the camera and pokes nothing
_MAX_CLICK_MOVE = 4

# samples a pixel for anti-aliasing, with a GPU
_MULTISAMPLES = 8

# [s]: time between two changes of the status line, since text is slow to draw
_STATUS_INTERVAL = 0.25


class Window:
    """A session in a PyVista plotter, on screen or off.

    It advances frame by frame, takes the user's input, and writes texts over the picture.

    Parameters
    ----------
    session : Session
    size : (width, height)
        [pixels].
    off_screen : bool
        Draw without a window, for tests.
    folder : path
        Where screenshots and videos go.

    Attributes
    ----------
    plotter : pyvista.Plotter
    stage : Stage
    recorder : Recorder
    closed : bool
        Whether the user wants to leave.
    drawn : bool
        Whether the latest frame shows the present state.
    message : str
        Latest message to the user.
    seconds_drawing : float
        Time that drawing has taken so far [s].

    Raises
    ------
    VideoError
        If the size cannot be drawn.
    """

    def __init__(
        self,
        session: Session,
        *,
        size: tuple[int, int] = (800, 600),
        off_screen: bool = False,
        folder: str | Path = ".",
    ) -> None:
        check_size(*size)
        self.session = session
        self.message = ""
        self.seconds_drawing = 0.0
        self.drawn = False
        self._updates = 0
        self._since = time.perf_counter()
        self._rate = math.nan
        scene = session.simulation.scene
        self.recorder = Recorder(Path(folder), scene.name, session.fps)
        # where there is no display VTK warns of that, and then does without one
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
        self.plotter = pv.Plotter(
            off_screen=off_screen, window_size=list(size), lighting="none", title=scene.name
        )
        # smooth edges cost software OpenGL four fifths of its speed
        self.plotter.render_window.SetMultiSamples(0)
        self.stage = Stage(self.plotter, session)
        self._text, self._help = (
            self.plotter.add_text(
                text, position=corner, font_size=size, color="black", shadow=False
            )
            for text, corner, size in (("", "upper_left", 9), (help_text(), "upper_right", 8))
        )
        self.update()
        self._sliders = add_sliders(self.plotter, session)
        self.closed = False
        self._pressed: tuple[int, int] | None = None
        iren = self.plotter.iren
        iren.clear_key_event_callbacks()
        # keys are ours: the style's own ones end the program, draw wire frames and the like
        iren.style.AddObserver("CharEvent", lambda *_: None)
        # A weak reference: PyVista keeps each plotter until it is closed, and the plotter of a
        # deleted window must be closed.
        me = weakref.proxy(self)
        iren.add_observer(
            "KeyPressEvent", lambda *_: me.key(me.plotter.iren.interactor.GetKeySym())
        )
        iren.add_observer("LeftButtonPressEvent", lambda *_: me._press())
        iren.add_observer("LeftButtonReleaseEvent", lambda *_: me._release())
        iren.add_observer("RenderEvent", lambda *_: me.mark_stale())
        iren.add_observer("ExitEvent", lambda *_: me.quit())
        self._closed_with = weakref.finalize(self, self.plotter.close)

    def pause(self) -> None:
        """Pause, or resume."""
        self.session.paused = not self.session.paused
        self.say("")

    def step(self) -> None:
        """Advance by one frame and pause."""
        self.session.paused = True
        try:
            self.session.step()
        except RippleError as error:
            self.say(f"{error}; r: reset")
        self.update()

    def reset(self) -> None:
        """Start again."""
        self.session.reset()
        self.say("")
        self.update()

    def poke_at(self, x: int, y: int) -> bool:
        """Poke the surface under a pixel, which is counted from the lower left.

        Returns whether there is a rippling surface.
        """
        return self.session.poke(*ray(self.plotter.renderer, x, y)) is not None

    def throw(self) -> None:
        """Throw a ball from the camera at the pointer.

        The target is the middle of the window if the pointer has never been over it.
        """
        width, height = self.size()
        x, y = self.pointer() or (width // 2, height // 2)
        if not self.session.throw(*ray(self.plotter.renderer, x, y)):
            self.say("this scene has no ball to throw")

    def operator(self) -> None:
        """Switch to the next wave operator."""
        following = OPERATORS[(OPERATORS.index(self.session.operator) + 1) % len(OPERATORS)]
        self.session.set_operator(following)
        self.say("")

    def colors(self) -> None:
        """Show the height as colours, or the surface in its own."""
        self.stage.toggle_heatmap()
        self.mark_stale()

    def screenshot(self) -> None:
        """Write an image."""
        self.draw()
        try:
            self.say(f"wrote {self.recorder.save(self.pixels())}")
        except RippleError as error:
            self.say(str(error))

    def record(self) -> None:
        """Begin a video, or end it."""
        recorder = self.recorder
        try:
            if recorder.recording:
                self.say(f"wrote {recorder.stop()}")
            else:
                self.say(f"recording {recorder.start(self.pixels())}")
        except RippleError as error:
            self.say(str(error))

    def help(self) -> None:
        """Show or hide the list of keys."""
        self._help.SetVisibility(not self._help.GetVisibility())
        self.mark_stale()

    def quit(self) -> None:
        """Leave."""
        self.closed = True

    def pixels(self) -> NDArray[np.uint8]:
        """The latest frame, uint8 [height, width, 3]."""
        pixels = vtkUnsignedCharArray()
        (width, height) = self.size()
        self.plotter.render_window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1]

    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.plotter.render_window.GetSize()

    def status(self) -> str:
        """Time, operator and state; in a second line the latest message."""
        session = self.session
        state = (
            "paused" if session.paused else f"{self._rate:.0f} updates/s" if self._rate > 0 else ""
        )
        recording = "   recording" if self.recorder.recording else ""
        return (
            f"{session.time:.2f} s   operator {session.operator}   {state}{recording}\n"
            f"{self.message}"
        )

    def say(self, message: str) -> None:
        """Show a message in the status line."""
        self.message = message
        self._show_status()

    def update(self) -> None:
        """Bring the stage up to date with the session."""
        self.stage.update()
        self.mark_stale()

    def mark_stale(self) -> None:
        """Have the frame drawn again at the next tick."""
        self.drawn = False

    def draw(self) -> None:
        """Draw the frame, and add it to a video that is being recorded."""
        now = time.perf_counter()
        self._updates += 1
        if now - self._since > _STATUS_INTERVAL:
            self._rate = self._updates / (now - self._since)
            self._updates = 0
            self._since = now
            self._show_status()
        level(self.plotter.camera)
        self.plotter.renderer.ResetCameraClippingRange()
        self.plotter.render_window.Render()
        self.drawn = True
        self.seconds_drawing += time.perf_counter() - now
        if self.recorder.recording:
            try:
                if not self.recorder.add(self.pixels()):
                    self.say("the window has changed its size: the recording has ended")
            except RippleError as error:
                self.say(str(error))

    def _show_status(self) -> None:
        if self._text.GetVisibility():
            self._text.set_text("upper_left", self.status())
        self.mark_stale()

    def open(self) -> None:
        """Show the window."""
        self.plotter.show(interactive_update=True, auto_close=False, interactive=False)
        if not is_software(self.gl_renderer):
            self.plotter.render_window.SetMultiSamples(_MULTISAMPLES)
        # the loop draws, once a frame; sliders and the camera would draw at every movement of the
        # pointer
        self.plotter.iren.interactor.EnableRenderOff()
        self.mark_stale()

    def close(self) -> None:
        """Close the window and finish a video."""
        self.quit()
        try:
            self.recorder.stop()
        finally:
            self._closed_with()

    def tick(self) -> bool:
        """Advance by one frame, and draw it.

        Returns whether a new frame was drawn.
        """
        try:
            moved = self.session.advance()
        except RippleError as error:
            self.say(f"{error}; r: reset")
            moved = True
        if moved:
            self.update()
        if self.drawn:
            return False
        self.draw()
        return True

    @property
    def gl_renderer(self) -> str:
        """OpenGL driver of an open window, by its own name."""
        lines = self.plotter.render_window.ReportCapabilities().splitlines()
        return next(
            (line.split(":", 1)[1].strip() for line in lines if line.startswith("OpenGL renderer")),
            "none",
        )

    def pointer(self) -> tuple[int, int] | None:
        """The pixel under the pointer, from the lower left.

        None if the pointer has never been over the window.
        """
        x, y = self.plotter.iren.get_event_position()
        return None if (x, y) == (0, 0) else (x, y)

    def _press(self) -> None:
        self._pressed = self.plotter.iren.get_event_position()

    def _release(self) -> None:
        """Poke where the pointer is, if it was pressed there."""
        pressed = self._pressed
        self._pressed = None
        x, y = self.plotter.iren.get_event_position()
        if pressed is not None and max(abs(x - pressed[0]), abs(y - pressed[1])) <= _MAX_CLICK_MOVE:
            self.poke_at(x, y)

    def key(self, name: str) -> None:
        """Carry out the action of a key, in upper or lower case; other keys do nothing."""
        for key, action, _ in CONTROLS:
            if name.lower() == key:
                getattr(self, action)()


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
    """Measure the highest update rate of a window.

    The report also has the time of simulation and drawing, and the processor time.

    The best of several runs of some updates without waiting, each with a poke and a ball at the
    start. Processor time is that of all threads, which other programs hardly change.
    """
    window.open()
    width, height = window.size()
    trials = []
    for _ in range(tries):
        window.reset()
        window.poke_at(width // 2, height // 2)
        window.throw()
        start = time.perf_counter()
        processor = time.process_time()
        drawing = window.seconds_drawing
        for _ in range(updates):
            window.tick()
        seconds = time.perf_counter() - start
        processor = time.process_time() - processor
        trials.append((seconds, window.seconds_drawing - drawing, processor))
    renderer = window.gl_renderer
    window.close()
    seconds, drawing, processor = min(trials)
    per_update = 1e3 / updates  # [ms] for each second of all updates
    return (
        f"{updates / seconds:.1f} updates/s: "
        f"simulation {per_update * (seconds - drawing):.1f} ms, "
        f"drawing {per_update * drawing:.1f} ms; "
        f"{per_update * processor:.1f} ms of processor time ({renderer})"
    )


def check_display() -> None:
    """Check that a window can be opened.

    Raises `DisplayError` with the missing part and the alternatives.
    """
    problem = display_problem()
    if problem:
        raise DisplayError(
            f"no window can be opened: {problem}; leave out --window to use a browser instead, or "
            "render a video with `ripple-sim render` or `ripple-sim drop`"
        )
