"""The window: shows a session with PyVista, and turns keys, clicks and sliders into calls of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkUnsignedCharArray

from ripple_sim.capture.viewpoint import viewpoint
from ripple_sim.render.visuals.looks import find_look
from ripple_sim.solver import RippleError

from .actors import BACKGROUND, HEIGHT, BodyActors, SkinActor
from .controls import CONTROLS, help_text
from .orbit import level, ray
from .recorder import Recorder
from .session import OPERATORS, Session
from .shadows import Shadows, find_floor
from .sliders import add_sliders

# A click that moves the pointer by more than this turns the camera and pokes nothing [pixels].
_STILL = 4
# Bodies farther away than this many distances of the first camera wait for their turn, and are not shown.
_REACH = 4.0
# The status line is written anew this often [s]: text is slow to draw.
_STATUS_EVERY = 0.25
_MULTISAMPLES = 8
_SOFTWARE = ("llvmpipe", "softpipe", "swrast")


class Window:
    """A session in a PyVista plotter, on screen or off.

    Parameters
    ----------
    session : Session
    size : (width, height)
        [pixels].
    off_screen : bool
        Draw without a window: for the web page and for tests.
    folder : path
        Where screenshots and videos go.

    Attributes
    ----------
    plotter : pyvista.Plotter
    closed : bool
        Whether the user wants to leave.
    message : str
        What happened last.
    seconds_drawing : float
        Time that drawing has taken so far [s].
    render : callable
        Draws the picture; a web page puts in its own, which also sends it.
    """

    def __init__(
        self,
        session: Session,
        *,
        size: tuple[int, int] = (800, 600),
        off_screen: bool = False,
        folder: str | Path = ".",
    ) -> None:
        self.session = session
        self.closed = False
        self.message = ""
        self.seconds_drawing = 0.0
        scene = session.simulation.scene
        self._recorder = Recorder(Path(folder), scene.name, session.fps)
        self._colored = True
        self._drawn = False
        self._updates, self._since, self._rate = 0, time.perf_counter(), math.nan
        self._pressed: tuple[int, int] | None = None
        # where there is no display VTK warns of that, and then does without one
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
        self.plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), lighting="none", title=scene.name)
        # smooth edges cost software OpenGL four fifths of its speed
        self.plotter.render_window.SetMultiSamples(0)
        # shadows lie side by side on the floor: plain blending will do, without buffers of the window's size
        self.plotter.renderer.SetUseOIT(False)
        self.plotter.set_background(BACKGROUND)
        self._light()
        data = session.simulation.data
        pose = viewpoint(session.simulation.model, data, scene.camera, 0.0).pose()
        self._skins = {
            entry.geom: SkinActor(self.plotter, session.skins[entry.geom], entry.color or find_look(entry.look).color)
            for entry in scene.targets
        }
        self._bodies = BodyActors(self.plotter, session, pose.focus, _REACH * pose.distance)
        floor = find_floor(session.simulation.model, data)
        casting = [*session.simulation.ripples.geom_ids.values(), *self._bodies.solid]
        self._shadows = None if floor is None else Shadows(self.plotter, session, casting, floor)
        self._add_bar()
        self._sliders = add_sliders(self.plotter, session)
        self._text = self.plotter.add_text("", position="upper_left", font_size=9, color="black", shadow=False)
        self._help = self.plotter.add_text(
            help_text(), position="upper_right", font_size=8, color="black", shadow=False
        )
        camera = self.plotter.camera
        camera.position, camera.focal_point, camera.up = pose.position, pose.focus, (0.0, 0.0, 1.0)
        camera.view_angle = pose.fovy
        self.render: Callable[[], object] = self.plotter.render_window.Render
        self._observe()
        self._update()

    def open(self) -> None:
        """Show the window."""
        self.plotter.show(interactive_update=True, auto_close=False, interactive=False)
        if not any(word in self.gl_renderer for word in _SOFTWARE):
            self.plotter.render_window.SetMultiSamples(_MULTISAMPLES)
        # the loop draws, once a frame; sliders and the camera would draw at every movement of the pointer
        self.plotter.iren.interactor.EnableRenderOff()
        self._drawn = False

    def close(self) -> None:
        """Close the window and finish a video."""
        self.closed = True
        try:
            self._recorder.stop()
        finally:
            self.plotter.close()

    def tick(self, draw: bool = True) -> bool:
        """Go on by one frame, and draw it if asked to; return whether there was anything new and it was drawn."""
        try:
            moved = self.session.advance()
        except RippleError as error:
            self._say(f"{error}; r: reset")
            moved = True
        if moved:
            self._update()
        if self._drawn or not draw:
            return False
        self._draw()
        return True

    @property
    def gl_renderer(self) -> str:
        """OpenGL driver of an open window, as it names itself."""
        lines = self.plotter.render_window.ReportCapabilities().splitlines()
        return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("OpenGL renderer")), "none")

    def picture(self) -> NDArray[np.uint8]:
        """What was drawn last, uint8 [height, width, 3]."""
        window, pixels = self.plotter.render_window, vtkUnsignedCharArray()
        width, height = window.GetSize()
        window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
        return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1]

    def key(self, name: str) -> None:
        """Do what a key stands for, large or small; other keys do nothing."""
        for control in CONTROLS:
            if name.lower() == control.key:
                getattr(self, control.action)()

    def pause(self) -> None:
        """Pause, or go on."""
        self.session.paused = not self.session.paused
        self._say("")

    def step(self) -> None:
        """Go on by one frame and pause."""
        self.session.paused = True
        try:
            self.session.step()
        except RippleError as error:
            self._say(f"{error}; r: reset")
        self._update()

    def reset(self) -> None:
        """Start again."""
        self.session.reset()
        self._say("")
        self._update()

    def poke_at(self, x: int, y: int) -> bool:
        """Press on what is under a pixel, counted from the lower left; return whether that is a rippling surface."""
        return self.session.poke(*ray(self.plotter.renderer, x, y)) is not None

    def throw(self) -> None:
        """Throw a ball from the camera at what is under the pointer."""
        x, y = self.plotter.iren.get_event_position()
        if (x, y) == (0, 0):  # it has never been over the window
            width, height = self.plotter.render_window.GetSize()
            x, y = width // 2, height // 2
        if not self.session.throw(*ray(self.plotter.renderer, x, y)):
            self._say("this scene has no ball to throw")

    def operator(self) -> None:
        """Take the next wave operator."""
        following = OPERATORS[(OPERATORS.index(self.session.operator) + 1) % len(OPERATORS)]
        self.session.set_operator(following)
        self._say("")

    def colors(self) -> None:
        """Show the height as colours, or the surface in its own."""
        self._colored = not self._colored
        self._bar.SetVisibility(self._colored)
        self._update()

    def screenshot(self) -> None:
        """Write a picture."""
        self._draw()
        try:
            self._say(f"wrote {self._recorder.save(self.picture())}")
        except RippleError as error:
            self._say(str(error))

    def record(self) -> None:
        """Begin a video, or end it."""
        try:
            if self._recorder.recording:
                self._say(f"wrote {self._recorder.stop()}")
            else:
                self._say(f"recording {self._recorder.start(self.picture())}")
        except RippleError as error:
            self._say(str(error))

    def help(self) -> None:
        """Show or hide the list of keys."""
        self._help.SetVisibility(not self._help.GetVisibility())
        self._drawn = False

    def quit(self) -> None:
        """Leave."""
        self.closed = True

    def status(self) -> str:
        """Time, operator, what is going on; and what happened last in a second line."""
        session = self.session
        state = "paused" if session.paused else f"{self._rate:.0f} updates/s" if self._rate > 0 else ""
        recording = "   recording" if self._recorder.recording else ""
        return f"{session.time:.2f} s   operator {session.operator}   {state}{recording}\n{self.message}"

    def hide_texts(self) -> None:
        """Leave the status line and the list of keys out of the picture."""
        for text in (self._text, self._help):
            text.SetVisibility(False)

    def _update(self) -> None:
        """Bring the actors up to date with the session."""
        session = self.session
        data, limit = session.simulation.data, _round_up(session.color_range)
        for name, skin in self._skins.items():
            geom = session.simulation.ripples.geom_ids[name]
            skin.update(data.geom_xpos[geom], data.geom_xmat[geom])
            skin.color_by_height(limit if self._colored else None)
        self._bodies.update()
        if self._shadows is not None:
            self._shadows.update()
        self._drawn = False

    def _draw(self) -> None:
        now = time.perf_counter()
        self._updates += 1
        if now - self._since > _STATUS_EVERY:
            self._rate = self._updates / (now - self._since)
            self._updates, self._since = 0, now
            self._show_status()
        level(self.plotter.camera)
        self.plotter.renderer.ResetCameraClippingRange()
        self.render()
        self._drawn = True
        self.seconds_drawing += time.perf_counter() - now
        if self._recorder.recording:
            try:
                if not self._recorder.add(self.picture()):
                    self._say("the window has changed its size: the recording has ended")
            except RippleError as error:
                self._say(str(error))

    def _say(self, message: str) -> None:
        self.message = message
        self._show_status()

    def _show_status(self) -> None:
        if self._text.GetVisibility():
            self._text.set_text("upper_left", self.status())
        self._drawn = False

    def _light(self) -> None:
        # two lamps that turn with the camera: each one more costs software OpenGL a tenth of its speed
        for position, intensity in (((-0.7, 1.0, 0.9), 0.85), ((1.0, 0.1, 0.5), 0.25)):
            self.plotter.add_light(pv.Light(position=position, light_type="camera light", intensity=intensity))

    def _add_bar(self) -> None:
        first = next(iter(self._skins.values()))
        bar = self.plotter.add_scalar_bar(
            HEIGHT, mapper=first.actor.mapper, vertical=True, position_x=0.9, position_y=0.2, width=0.06, height=0.4,
            n_labels=3, fmt="%.3g", title_font_size=13, label_font_size=12, color="black",
        )  # fmt: skip
        bar.SetVerticalTitleSeparation(10)
        self._bar = bar

    def _observe(self) -> None:
        iren = self.plotter.iren
        iren.clear_key_event_callbacks()
        # keys are ours: the style's own ones end the program, draw wire frames and the like
        self.plotter.iren.style.AddObserver("CharEvent", lambda *_: None)
        iren.add_observer("KeyPressEvent", lambda *_: self.key(iren.interactor.GetKeySym()))
        iren.add_observer("LeftButtonPressEvent", lambda *_: self._press())
        iren.add_observer("LeftButtonReleaseEvent", lambda *_: self._release())
        iren.add_observer("RenderEvent", lambda *_: self._stale())
        iren.add_observer("ExitEvent", lambda *_: self.quit())

    def _press(self) -> None:
        self._pressed = self.plotter.iren.get_event_position()

    def _release(self) -> None:
        pressed, self._pressed = self._pressed, None
        x, y = self.plotter.iren.get_event_position()
        if pressed is not None and max(abs(x - pressed[0]), abs(y - pressed[1])) <= _STILL:
            self.poke_at(x, y)

    def _stale(self) -> None:
        self._drawn = False


def _round_up(value: float) -> float:
    """Round up to 1, 2 or 5 times a power of ten, so that a scale does not change at every frame."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if value <= step * power * (1 + 1e-12))
