"""`Pages`: the browsers that show a run, and what they ask for."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec
import mujoco

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.export.source import Source
from ripple_sim.solver import RippleError

from .page_stream import PageStream

# A page that does not open its socket for this long is forgotten [s].
_OPENING_TIME = 20.0

# Number of a command's target that means all of them.
ALL_TARGETS = -1

Point = tuple[float, float, float]


class Command(msgspec.Struct, forbid_unknown_fields=True):
    """What a page asks for: `do` names it, and the others are its arguments."""

    do: str
    target: int = 0
    point: Point = (0.0, 0.0, 0.0)
    way: Point = (0.0, 0.0, 1.0)
    strength: float = 1.0
    body: int = 0
    name: str = ""
    factors: dict[str, float] = {}
    camera: dict[str, Any] = {}


def target_of(command: Command, names: Sequence[str]) -> str:
    """Name of the target that a command means.

    Raises `ValueError` if there is no target of its number.
    """
    if not 0 <= command.target < len(names):
        raise ValueError(
            f"target must be a number from 0 to {len(names) - 1}, got {command.target}"
        )
    return names[command.target]


class Pages:
    """The pages of a run.

    The server's threads call `open`, `connect`, `leave` and `ask`; the run calls the others, and
    holds `lock` while it changes the run.

    Parameters
    ----------
    source : Source
        What the pages show.
    data : mujoco.MjData
        The state of the run.
    menu : callable
        What the controls of a new page offer.

    Attributes
    ----------
    lock : threading.Lock
    """

    def __init__(
        self, source: Source, data: mujoco.MjData, menu: Callable[[], dict[str, Any]]
    ) -> None:
        self.lock = threading.Lock()
        self._source = source
        self._data = data
        self._menu = menu
        self._streams: dict[int, tuple[PageStream, float]] = {}  # with the time of opening [s]
        self._opened = 0
        self._rival = ""  # operator that pages show beside the run's
        self._messages: queue.Queue[tuple[PageStream, bytes | str]] = queue.Queue()

    def open(self) -> PageStream:
        """A new page of the present state."""
        with self.lock:
            self._opened += 1
            stream = PageStream(self._source, self._data, self._opened, self._menu())
            self._streams[self._opened] = stream, time.monotonic()
            if self._rival:
                stream.compare(self._rival)
        return stream

    def connect(self, number: str) -> PageStream | None:
        """The page of a number that waits for its socket; None without."""
        with self.lock:
            stream, _ = self._streams.get(int(number) if number.isdecimal() else 0, (None, 0.0))
            if stream is None or stream.connected:
                return None
            stream.connected = True
            return stream

    def leave(self, stream: PageStream) -> None:
        """Forget a page that was closed."""
        with self.lock:
            for number, (other, _) in list(self._streams.items()):
                if other is stream:
                    del self._streams[number]
                    stream.end()

    def ask(self, stream: PageStream, message: bytes | str) -> None:
        """Have a page's message carried out before the next frame."""
        self._messages.put((stream, message))

    @property
    def ready(self) -> bool:
        """Whether a page is there, and none is behind."""
        is_watched = any(stream.connected for stream, _ in self._streams.values())
        return is_watched and not self.is_behind

    @property
    def is_behind(self) -> bool:
        """Whether an open page has not yet received what was sent."""
        streams = [stream for stream, _ in self._streams.values()]
        return any(stream.is_full for stream in streams if stream.connected)

    def carry_out(self, actions: dict[str, Callable[[Command], None]]) -> None:
        """Carry out all messages; what is wrong with one is said to its page."""
        self._forget_the_absent()
        for stream, message in self._waiting_messages():
            try:
                command = msgspec.json.decode(message, type=Command)
                action = actions.get(command.do)
                if action is None:
                    valid = ", ".join(actions)
                    raise ValueError(f"command must be one of {valid}, got {command.do[:40]!r}")
                action(command)
            except (RippleError, ValueError, msgspec.DecodeError) as error:
                stream.tell(say=str(error))

    def send(self, impulses: Sequence[Impulse]) -> None:
        """Send the present state as a frame, with the impulses since the last one."""
        for stream, _ in self._streams.values():
            stream.add(self._data, impulses)

    def compare(self, operator: str) -> None:
        """Show the waves of another operator beside the run's; "": no longer.

        The latest frame that was sent must be the present state.
        """
        self._rival = operator
        for stream, _ in self._streams.values():
            stream.compare(operator)

    def repaint(self, source: Source, targets: Sequence[str]) -> None:
        """Show targets with the looks of a source from now on."""
        self._source = source
        for stream, _ in self._streams.values():
            stream.repaint(source, targets)

    def tell(self, **message: Any) -> None:
        """Send all pages a message."""
        for stream, _ in self._streams.values():
            stream.tell(**message)

    def end(self) -> None:
        """End all pages."""
        with self.lock:
            for stream, _ in self._streams.values():
                stream.end()
            self._streams.clear()

    def _waiting_messages(self) -> Iterator[tuple[PageStream, bytes | str]]:
        while not self._messages.empty():
            yield self._messages.get()

    def _forget_the_absent(self) -> None:
        now = time.monotonic()
        for number, (stream, opened) in list(self._streams.items()):
            if not stream.connected and now - opened > _OPENING_TIME:
                stream.end()
                del self._streams[number]
