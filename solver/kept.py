"""Results kept in memory for the next one who asks for the same: the next scene of a batch, or the next target."""

from __future__ import annotations

import functools
from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Result = TypeVar("Result")


class Kept(Generic[Result]):
    """The latest results by their keys. They are shared by all who ask, and not to be changed.

    Parameters
    ----------
    count : int
        How many at most.
    small : callable
        Whether a result is small enough to be kept.
    """

    def __init__(self, count: int, small: Callable[[Result], bool]) -> None:
        self._count, self._small = count, small
        self._results: OrderedDict[str, Result] = OrderedDict()

    def get(self, key: str, make: Callable[[], Result]) -> Result:
        """The result of a key, made if it is not there."""
        result = self._results.pop(key, None)
        if result is None:
            result = make()
        if self._small(result):
            self._results[key] = result
        while len(self._results) > self._count:
            self._results.popitem(last=False)
        return result


def kept_with(make: Callable[[Owner], Result]) -> Callable[[Owner], Result]:
    """Decorate what is made from one object, compared by identity: made once, and kept as long as the object lives."""
    results: WeakKeyDictionary[Owner, Result] = WeakKeyDictionary()

    @functools.wraps(make)
    def kept(owner: Owner) -> Result:
        result = results.get(owner)
        if result is None:
            result = results[owner] = make(owner)
        return result

    return kept
