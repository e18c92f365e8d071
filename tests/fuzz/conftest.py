"""Fuzzing leaves signals and warnings as it found them."""

import warnings
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def _left_as_found(signals_as_found: None) -> Iterator[None]:
    with warnings.catch_warnings(action="ignore"):
        yield
