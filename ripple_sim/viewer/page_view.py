"""`PageView`: a session in browsers: it advances in real time and carries out their commands.

MuJoCo and the waves run here; the pages get poses, loads and pokes, solve the waves themselves and
draw. Everything in this module runs in one thread but for `open` and `tell`.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.export.exporter import Exporter, scene_source
from ripple_sim.export.options import ExportOptions
from ripple_sim.export.renderer import RippleRenderer
from ripple_sim.export.source import Source
from ripple_sim.solver import Material, RippleError
from ripple_sim.solver.operator.presets import PRESETS

from .page_stream import PageStream
from .recorder import Recorder
from .session import OPERATORS, Session

# Size of recordings [pixels].
_RECORDED_SIZE = (1280, 720)

# A page that does not open its socket for this long is forgotten [s].
_OPENING_TIME = 20.0

# A mouse that drags a body pulls with a spring of this frequency [1/s], damped critically.
_DRAG_FREQUENCY = 12.0

# Factors of a material's coefficients that a page may ask for.
_FACTORS = ("speed", "damping", "stiffness")
_MAX_FACTOR = 8.0


class Command(msgspec.Struct, forbid_unknown_fields=True):
    """What a page asks for: `do` names it, and the others are its arguments."""

    do: str
    target: int = 0
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    way: tuple[float, float, float] = (0.0, 0.0, 1.0)
    strength: float = 1.0
    body: int = 0
    name: str = ""
    factors: dict[str, float] = {}
    camera: dict[str, Any] = {}


class PageView:
    """A session, the pages that show it, and what they ask for.

    Parameters
    ----------
    session : Session
    source : Source
        What the pages show.
    folder : path
        Where recordings and pages go.
    """

    def __init__(self, session: Session, source: Source, folder: str | Path = ".") -> None:
        self.session = session
        self.folder = Path(folder)
        self.closed = False
        self._source = source
        self._lock = threading.Lock()  # of the session
        self._streams: dict[int, tuple[PageStream, float]] = {}
        self._commands: queue.Queue[tuple[PageStream, bytes | str]] = queue.Queue()
        self._recorder = Recorder(self.folder, session.simulation.scene.name, session.fps)
        self._renderer: RippleRenderer | None = None
        self._camera: mujoco.MjvCamera | int = -1
        self._dragged: tuple[int, NDArray[np.float64], NDArray[np.float64]] | None = None
        self._material = {
            name: session.simulation.ripples[name].material for name in session.simulation.ripples
        }
        self._actions: dict[str, Callable[[Command], None]] = {
            "poke": self._poke,
            "throw": self._throw,
            "drag": self._drag,
            "drop": self._drop,
            "pause": lambda command: self._pause(True),
            "resume": lambda command: self._pause(False),
            "step": self._step,
            "reset": self._reset,
            "operator": self._change_operator,
            "preset": self._change_preset,
            "factors": self._change_factors,
            "record": self._record,
            "share": self._share,
            "quit": self._quit,
        }

    def open(self) -> PageStream:
        """A new page of the present state."""
        menu = {
            "operators": OPERATORS,
            "presets": list(PRESETS),
            "paused": self.session.paused,
            "movable": np.flatnonzero(self.session.simulation.model.body_dofnum).tolist(),
        }
        with self._lock:
            number = max(self._streams, default=0) + 1
            stream = PageStream(self._source, self.session.simulation.data, number, menu)
            self._streams[number] = stream, time.monotonic()
        return stream

    def stream(self, number: str) -> PageStream | None:
        """The page of a number that waits for its socket."""
        stream, _ = self._streams.get(int(number) if number.isdecimal() else 0, (None, 0.0))
        if stream is None or stream.connected:
            return None
        stream.connected = True
        return stream

    def leave(self, stream: PageStream) -> None:
        """Forget a page that was closed."""
        with self._lock:
            for number, (other, _) in list(self._streams.items()):
                if other is stream:
                    del self._streams[number]
                    stream.end()

    def tell(self, stream: PageStream, message: bytes | str) -> None:
        """Have a page's message carried out before the next frame."""
        self._commands.put((stream, message))

    def run(self) -> None:
        """Advance frame by frame, at most in real time, until a page or the program ends it."""
        frame = 1 / self.session.fps
        due = time.perf_counter()
        try:
            while not self.closed:
                self.tick()
                due = max(due + frame, time.perf_counter() - frame)
                time.sleep(max(0.001, due - time.perf_counter()))
        finally:
            self.close()

    def tick(self) -> None:
        """Carry out commands, and advance by a frame where a page waits for one."""
        with self._lock:
            self._forget_the_absent()
            while not self._commands.empty():
                stream, message = self._commands.get()
                self._carry_out(stream, message)
            pages = [stream for stream, _ in self._streams.values()]
            is_watched = any(stream.connected for stream in pages)
            if is_watched and not self.session.paused and not any(s.is_full for s in pages):
                self._advance()

    def close(self) -> None:
        """End all pages, and a recording."""
        self.closed = True
        self._recorder.stop()
        if self._renderer is not None:
            self._renderer.close()
        for stream, _ in self._streams.values():
            stream.end()

    def _forget_the_absent(self) -> None:
        now = time.monotonic()
        for number, (stream, opened) in list(self._streams.items()):
            if not stream.connected and now - opened > _OPENING_TIME:
                stream.end()
                del self._streams[number]

    def _carry_out(self, stream: PageStream, message: bytes | str) -> None:
        """Carry out a message; what is wrong with it is said to its page."""
        try:
            command = msgspec.json.decode(message, type=Command)
            action = self._actions.get(command.do)
            if action is None:
                valid = ", ".join(self._actions)
                raise ValueError(f"command must be one of {valid}, got {command.do[:40]!r}")
            action(command)
        except (RippleError, ValueError, msgspec.DecodeError) as error:
            stream.tell(say=str(error))

    def _advance(self) -> None:
        """Advance by a frame, and send it."""
        self._pull()
        try:
            self.session.simulation.advance_frame()
        except RippleError as error:
            self._pause(True)
            self._say(f"{error}; restart with R")
        self._send(self.session.simulation.impulses)
        if self._recorder.recording:
            self._recorder.add(self._picture())

    def _send(self, impulses: list[Impulse]) -> None:
        for stream, _ in self._streams.values():
            stream.add(self.session.simulation.data, impulses)

    def _say(self, message: str) -> None:
        for stream, _ in self._streams.values():
            stream.tell(say=message)

    def _poke(self, command: Command) -> None:
        ripples = self.session.simulation.ripples
        names = list(ripples)
        if not 0 <= command.target < len(names):
            raise ValueError(
                f"target must be a number from 0 to {len(names) - 1}, got {command.target}"
            )
        radius = self.session.poke_radius
        impulse = command.strength * self.session.poke_impulse
        ripples[names[command.target]].add_impulse(command.point, impulse, radius)

    def _throw(self, command: Command) -> None:
        if not self.session.throw(command.point, command.way):
            raise ValueError("this scene has no ball to throw")

    def _drag(self, command: Command) -> None:
        """Pull a body: `point` is where it was taken, in its frame, and `way` where that goes."""
        model = self.session.simulation.model
        if (
            not 0 < command.body < model.nbody
            or not np.isfinite([*command.point, *command.way]).all()
        ):
            raise ValueError(f"body must be a number from 1 to {model.nbody - 1}")
        self._dragged = command.body, np.array(command.point), np.array(command.way)

    def _drop(self, command: Command) -> None:
        self._dragged = None
        self.session.simulation.data.xfrc_applied[:] = 0

    def _pull(self) -> None:
        """Pull the body that is dragged towards the pointer, by a spring."""
        if self._dragged is None:
            return
        body, place, goal = self._dragged
        data = self.session.simulation.data
        model = self.session.simulation.model
        rotation = data.xmat[body].reshape(3, 3)
        arm = rotation @ place
        point = data.xpos[body] + arm
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
        moving = velocity[3:] + np.cross(velocity[:3], arm)
        mass = model.body_subtreemass[body]
        spring = _DRAG_FREQUENCY**2 * (goal - point) - 2 * _DRAG_FREQUENCY * moving
        force = mass * (spring - model.opt.gravity)
        data.xfrc_applied[body] = [*force, *np.cross(point - data.xipos[body], force)]

    def _pause(self, paused: bool) -> None:
        self.session.paused = paused
        for stream, _ in self._streams.values():
            stream.tell(paused=paused)

    def _step(self, command: Command) -> None:
        self._pause(True)
        self._advance()

    def _reset(self, command: Command) -> None:
        self._drop(command)
        self.session.reset()
        for stream, _ in self._streams.values():
            stream.tell(reset=True)
        self._send([])

    def _change_operator(self, command: Command) -> None:
        self.session.set_operator(command.name)
        self._send([])

    def _change_preset(self, command: Command) -> None:
        """Give all surfaces a real material, or their own again for an empty name."""
        for name, own in self._material.items():
            material = Material.preset(command.name) if command.name else own
            self.session.simulation.ripples.change_material(name, **vars(material))
        self._send([])

    def _change_factors(self, command: Command) -> None:
        """Multiply coefficients of the scene's own materials."""
        for factor in command.factors.values():
            if not 0 <= factor <= _MAX_FACTOR:
                raise ValueError(f"a factor must be from 0 to {_MAX_FACTOR:g}, got {factor!r}")
        for name, own in self._material.items():
            changed = {
                key: command.factors.get(key, 1.0) * np.asarray(getattr(own, key))
                for key in _FACTORS
            }
            self.session.simulation.ripples.change_material(name, **changed)
        self._send([])

    def _record(self, command: Command) -> None:
        """Begin a video by the real renderer, from the page's camera, or end it."""
        if self._recorder.recording:
            self._say(f"wrote {self._recorder.stop()}")
            return
        self._camera = free_camera(command.camera)
        self._say(f"recording {self._recorder.start(self._picture())}")

    def _picture(self) -> NDArray[np.uint8]:
        simulation = self.session.simulation
        if self._renderer is None:
            width, height = _RECORDED_SIZE
            looks = {name: look for name, (look, _) in self._source.paints.items()}
            self._renderer = RippleRenderer(
                simulation.model,
                simulation.ripples,
                height,
                width,
                looks=looks,
                lighting=self._source.lighting,
            )
        self._renderer.update_scene(simulation.data, camera=self._camera)
        return self._renderer.render()

    def _share(self, command: Command) -> None:
        """Write the present state as a page of its own, which needs no server."""
        number = 1
        while (
            path := self.folder / f"{self.session.simulation.scene.name}-{number}.html"
        ).exists():
            number += 1
        with Exporter.of(self._source, path) as exporter:
            exporter.write(self.session.simulation.data, [])
        self._say(f"wrote {path}")

    def _quit(self, command: Command) -> None:
        self.closed = True


def free_camera(entry: dict[str, Any]) -> mujoco.MjvCamera | int:
    """The free camera of a page: lookat, distance, azimuth and elevation; MuJoCo's without."""
    if not entry:
        return -1
    camera = mujoco.MjvCamera()
    camera.lookat = entry["lookat"]
    camera.distance = entry["distance"]
    camera.azimuth = entry["azimuth"]
    camera.elevation = entry["elevation"]
    return camera


def view_of(session: Session, folder: str | Path, resolution: int | None) -> PageView:
    """The view of a session of a scene."""
    simulation = session.simulation
    options = ExportOptions(fps=session.fps, resolution=resolution)
    return PageView(session, scene_source(simulation.scene, simulation, options), folder)
