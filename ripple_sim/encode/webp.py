"""Animated WebP files, assembled from still images.

The container is RIFF, see "WebP Container Specification" by Google: VP8X (size and flags), ANIM
(background, loops), an ANMF chunk for each frame with the chunks of a still image, and XMP with the
mark of this program.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

from .clip import Stream
from .replace import MARK

# flags of the VP8X chunk
_ANIMATION = 0x02
_METADATA = 0x04
_OPACITY = 0x10

# Where the first chunk of a file begins [bytes]: after "RIFF", the size and "WEBP".
_FIRST_CHUNK = 12

# flag of an ANMF chunk: the frame replaces the previous one
_DO_NOT_BLEND = 0x02

# byte of a VP8L chunk, and its bit, that say whether the image has opacity
_LOSSLESS_FLAGS = 12
_LOSSLESS_OPACITY = 0x10


def join_webp(stills: Sequence[Path], path: Path, stream: Stream) -> None:
    """Join still WebP files of the stream's size to an animation that repeats for ever."""
    flags = _ANIMATION | _METADATA
    canvas = b"".join((side - 1).to_bytes(3, "little") for side in (stream.width, stream.height))
    with path.open("wb") as file:
        # room for RIFF and VP8X: they are written last, with the size and the flags
        file.write(bytes(_FIRST_CHUNK + 8 + 10))
        file.write(riff_chunk(b"ANIM", struct.pack("<IH", 0, 0)))
        for number, still in enumerate(stills):
            # whole milliseconds, without accumulating the rounding error
            begin, end = (round(1000 * n / stream.fps) for n in (number, number + 1))
            image = _image_chunks(still.read_bytes())
            if image.startswith(b"ALPH") or (
                image.startswith(b"VP8L") and image[_LOSSLESS_FLAGS] & _LOSSLESS_OPACITY
            ):
                flags |= _OPACITY
            header = (
                bytes(6) + canvas + (end - begin).to_bytes(3, "little") + bytes([_DO_NOT_BLEND])
            )
            file.write(riff_chunk(b"ANMF", header + image))
        file.write(riff_chunk(b"XMP ", MARK.encode()))
        size = file.tell()
        file.seek(0)
        file.write(struct.pack("<4sI4s", b"RIFF", size - 8, b"WEBP"))
        file.write(riff_chunk(b"VP8X", struct.pack("<I", flags) + canvas))


def _image_chunks(still: bytes) -> bytes:
    """The chunks of a still WebP that make up its image."""
    at = _FIRST_CHUNK
    image = b""
    while at < len(still):
        name, size = struct.unpack_from("<4sI", still, at)
        end = at + 8 + size + size % 2
        if name in (b"ALPH", b"VP8 ", b"VP8L"):
            image += still[at:end]
        at = end
    return image


def riff_chunk(name: bytes, content: bytes) -> bytes:
    """A chunk of a RIFF file, of an even length."""
    return struct.pack("<4sI", name, len(content)) + content + bytes(len(content) % 2)
