"""Double buffering: an iterator in a thread of its own, a few items ahead of its consumer."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Iterable, Iterator
from typing import Generic, TypeVar

Item = TypeVar("Item")

_END = object()


class Prefetch(Generic[Item]):
    """Runs an iterable in a thread, at most `depth` items ahead; iterate over this instead, inside a `with`.

    Items come in their order. An exception of the iterable is raised in place of its next item. Leaving the block stops
    the thread at its current item.

    Parameters
    ----------
    items : iterable
        Consumed by the thread alone.
    depth : int
        How many finished items may wait.
    """

    def __init__(self, items: Iterable[Item], depth: int) -> None:
        self._items = items
        self._queue: queue.Queue[tuple[object, BaseException | None]] = queue.Queue(depth)
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)

    def __enter__(self) -> Iterator[Item]:
        self._thread.start()
        return self._take()

    def __exit__(self, *error: object) -> None:
        self._stopped = True
        while self._thread.is_alive():
            with contextlib.suppress(queue.Empty):  # makes room for the thread's current item
                self._queue.get(timeout=0.05)

    def _run(self) -> None:
        error: BaseException | None = None
        try:
            for item in self._items:
                if self._stopped:
                    return
                self._queue.put((item, None))
        except BaseException as failure:  # of any kind: it is raised in the consumer's thread
            error = failure
        self._queue.put((_END, error))

    def _take(self) -> Iterator[Item]:
        while True:
            item, error = self._queue.get()
            if error is not None:
                raise error
            if item is _END:
                return
            yield item  # type: ignore[misc]
