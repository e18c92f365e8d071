"""Text and numbers of mesh files."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError

# A whole number that fits an int64.
_WHOLE = re.compile(r"[-+]?\d{1,15}", flags=re.ASCII)


def decoded(content: bytes) -> str:
    """Text of a file; bytes that are not UTF-8 can only stand in names and comments.

    Windows may put a byte order mark in front, and write UTF-16.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16", errors="replace")
    if content[1:2] == b"\0" and content[:1] != b"\0":
        return content.decode("utf-16-le", errors="replace")
    if content[:1] == b"\0" and content[1:2] != b"\0":
        return content.decode("utf-16-be", errors="replace")
    return content.decode("utf-8-sig", errors="replace")


def three(words: Sequence[str], number: int, unit: str = "line") -> Sequence[str]:
    """The first three words; `unit` and `number` say in the message where they stand."""
    if len(words) < 3:
        raise MeshError(f"{unit} {number} must have 3 coordinates, got {len(words)}")
    return words[:3]


def numbers(words: Sequence[str]) -> NDArray[np.float64]:
    """Numbers of words."""
    try:
        return np.array(words, dtype=np.float64)
    except ValueError as error:
        raise MeshError(f"a coordinate is not a number: {error}") from error


def whole(word: str) -> int:
    """Whole number of a word."""
    if not _WHOLE.fullmatch(word):
        raise MeshError(f"expected a whole number, found {word[:40]!r}")
    return int(word)
