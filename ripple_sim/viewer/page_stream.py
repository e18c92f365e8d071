"""`PageStream`: a page in a browser, which gets the frames of a session as they happen."""

from __future__ import annotations

import json
import queue
import zlib
from collections.abc import Sequence
from typing import Any

import mujoco

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.export.page_coding import packed
from ripple_sim.export.page_content import PageContent
from ripple_sim.export.source import Source

# Messages that may wait for the browser: with more of them the simulation waits, since the page
# needs the loads of every frame.
_MAX_WAITING = 8

_COMPRESSION = 1  # of zlib: frames are small, and a tunnel is faster than the page


class PageStream:
    """The page of one browser.

    Parameters
    ----------
    source : Source
    data : mujoco.MjData
        The present state, with which the page begins.
    number : int
        Of the stream; the page gives it with its socket.
    menu : mapping
        What the page's controls offer.

    Attributes
    ----------
    text : str
        The page itself.
    messages : queue.Queue
        What waits for the browser: bytes are frames, text is JSON, None is the end.
    connected : bool
        Whether the page has opened its socket.
    """

    def __init__(
        self, source: Source, data: mujoco.MjData, number: int, menu: dict[str, Any]
    ) -> None:
        self.messages: queue.Queue[bytes | str | None] = queue.Queue()
        self.connected = False
        self._rival = ""
        self._content = PageContent(source)
        stream = {"number": number, **menu}
        head = "".join(self._content.begin(data, chunk=1, stream=stream))
        self._content.add(data, [])
        first = packed(self._content.chunk().content)
        self.text = (
            f'{head}<script type="text/plain" class="chunk">{first}</script>\n</body></html>'
        )

    @property
    def is_full(self) -> bool:
        """Whether the browser is behind."""
        return self.messages.qsize() > _MAX_WAITING

    def add(self, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Send a frame, and the laws of surfaces that have changed since the last one."""
        self._content.add(data, impulses)
        laws = self._content.changed_laws()
        chunk = self._content.chunk()
        for target, motion in chunk.motions.items():
            self.tell(motion={"target": target, "content": motion})
        self.messages.put(zlib.compress(chunk.content, _COMPRESSION))
        for target, law in laws.items():
            self.tell(law={"target": target, "content": law})
        if laws and self._rival:
            self.compare(self._rival)

    def compare(self, operator: str) -> None:
        """Show the waves of another operator beside the run's from now on; "": no longer."""
        self._rival = operator
        laws = self._content.rival_laws(operator) if operator else {}
        self.tell(rival={"operator": operator, "laws": laws})

    def repaint(self, source: Source, targets: Sequence[str]) -> None:
        """Send the looks that targets have in a source."""
        for target, look in self._content.looks(source, targets).items():
            self.tell(look={"target": target, "content": look})

    def tell(self, **message: Any) -> None:
        """Send a message."""
        self.messages.put(json.dumps(message))

    def end(self) -> None:
        """End the stream."""
        self._content.end()
        self.messages.put(None)
