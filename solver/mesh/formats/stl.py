"""STL files as triangles: text or binary, with the colours that some programs put into binary ones.

A binary file may begin with the word "solid", as a text file does.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ..clean import counted
from ..looks import Looks, Paint, linear_light
from ..soup import Soup
from .text import decoded

# Bytes before the triangles of a binary file: a comment, and their number.
_COMMENT_BYTES = 80
_HEAD_BYTES = 84

# A triangle of a binary file: normal, corners and 16 bits, which may be a colour.
_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])

# Greatest value of a channel of five bits.
_CHANNEL = 31

_VERTEX = re.compile(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", flags=re.IGNORECASE)

# The comment of files of Materialise Magics, whose bits are another way round.
_MAGICS = b"COLOR="


def read_stl(path: Path) -> Soup:
    """Triangles of an STL file.

    Raises `MeshError` if the file ends early, or is neither text nor binary STL.
    """
    content = path.read_bytes()
    count = int.from_bytes(content[_COMMENT_BYTES:_HEAD_BYTES], "little")
    need = _HEAD_BYTES + _ROW.itemsize * count
    if len(content) >= _HEAD_BYTES and need == len(content):
        return _binary(content, count, ())
    begin = content[:1024].lstrip().lower()
    if begin.startswith((b"solid", b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")) and (
        b"facet" in content.replace(b"\0", b"").lower() or len(content) < _HEAD_BYTES
    ):
        return _text(content)
    if begin.startswith(b"solid") and b"endsolid" in content.lower():
        return _text(content)
    if len(content) < _HEAD_BYTES:
        raise MeshError("it is neither a text nor a binary STL file")
    if need > len(content):
        whole = (len(content) - _HEAD_BYTES) // _ROW.itemsize
        raise MeshError(
            f"it ends early: {counted(count, 'triangle')} are announced, data of {whole:,} follow"
        )
    behind = f"{counted(len(content) - need, 'byte')} behind the triangles left out"
    return _binary(content, count, (behind,))


def _binary(content: bytes, count: int, notes: tuple[str, ...]) -> Soup:
    table = np.frombuffer(content, _ROW, count, _HEAD_BYTES)
    V = table["corners"].reshape(-1, 3).astype(np.float64)
    F = np.arange(len(V)).reshape(-1, 3)
    return Soup(V, F, None, notes, _looks(table["color"], content[:_COMMENT_BYTES]))


def _looks(bits: NDArray[np.uint16], comment: bytes) -> Looks | None:
    """Colours of the 16 bits of each triangle, if they are colours."""
    channels = np.stack([bits >> 10, bits >> 5, bits], axis=1) & _CHANNEL
    colored = bits >= 1 << 15
    uncolored = np.ones(4)
    at = comment.find(_MAGICS)
    if at >= 0:
        # red is the lowest; the highest bit stands for the colour of the comment
        channels = channels[:, ::-1]
        colored = ~colored
        rgba = comment[at + len(_MAGICS) :][:4].ljust(4, b"\xff")
        uncolored = np.frombuffer(rgba, np.uint8) / 255
    elif not colored.any():
        return None
    colors = np.tile(uncolored, (len(bits), 1))
    colors[colored, :3] = channels[colored] / _CHANNEL
    colors = np.repeat(linear_light(colors)[:, None], 3, axis=1)
    return Looks((Paint(),), np.zeros(len(bits), np.int64), colors)


def _text(content: bytes) -> Soup:
    words = _VERTEX.findall(decoded(content))
    if len(words) % 3:
        raise MeshError(f"it ends early: {counted(len(words), 'corner')} are no whole triangles")
    try:
        V = np.array(words, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise MeshError(f"a coordinate is not a number: {error}") from error
    return Soup(V, np.arange(len(V)).reshape(-1, 3))
