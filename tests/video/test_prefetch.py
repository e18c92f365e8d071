"""A stage that runs ahead: the same items in the same order, no more of them than may wait, and its errors."""

import threading
import time
from collections.abc import Iterator

import pytest

from ripple_sim.video.render_video import Prefetch


def test_items_come_in_order_from_another_thread():
    threads = set()

    def items() -> Iterator[int]:
        for number in range(50):
            threads.add(threading.get_ident())
            yield number

    with Prefetch(items(), 3) as prefetched:
        assert list(prefetched) == list(range(50))
    assert len(threads) == 1
    assert threading.get_ident() not in threads


def test_it_runs_ahead_as_far_as_it_may_and_no_further():
    begun: list[int] = []

    def items() -> Iterator[int]:
        for number in range(50):
            begun.append(number)
            yield number

    with Prefetch(items(), 3) as prefetched:
        for number in prefetched:
            waited = time.monotonic() + 60
            # one is in the taker's hands, three wait, one is held until there is room
            while len(begun) < min(number + 5, 50) and time.monotonic() < waited:
                time.sleep(0.001)
            assert len(begun) == min(number + 5, 50)


def test_an_error_comes_where_the_next_item_would_have_come():
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise ZeroDivisionError

    taken = []
    with pytest.raises(ZeroDivisionError), Prefetch(items(), 3) as prefetched:
        for number in prefetched:
            taken.append(number)
    assert taken == [1, 2]


def test_leaving_early_stops_the_thread():
    def items() -> Iterator[int]:
        number = 0
        while True:
            yield number
            number += 1

    before = threading.active_count()
    with Prefetch(items(), 3) as prefetched:
        assert next(prefetched) == 0
    assert threading.active_count() == before
