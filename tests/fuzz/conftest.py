"""Fuzzing leaves signals and warnings as it found them."""

import signal
import warnings
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def _left_as_found() -> Iterator[None]:
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    with warnings.catch_warnings(action="ignore"):
        yield
    for number, handler in kept.items():
        signal.signal(number, handler)
