"""Named arrays in one file: an uncompressed NumPy archive, read at the speed of memory and verified.

NumPy's own reader goes through the zip module in small pieces. Here every array is read straight into place, on several
threads, and verified against the archive's checksum before use.
"""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

_LOCAL_HEADER = struct.Struct("<26xHH")  # how long the name and the extra field are that follow
_LONGEST_HEAD = 4096  # of an array: its shape and type


def write_arrays(file: BinaryIO, arrays: dict[str, NDArray]) -> None:
    """Write an archive that `read_arrays` and `numpy.load` read."""
    np.savez(file, allow_pickle=False, **arrays)


def read_arrays(path: Path) -> dict[str, NDArray]:
    """Read all arrays of an archive.

    Raises
    ------
    ValueError
        If the file is damaged, or is not such an archive.
    OSError
        If it cannot be read.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, NotImplementedError, struct.error) as error:
        raise ValueError(str(error)) from error
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        arrays = list(threads.map(lambda member: _read_array(path, member), members))
    return {member.filename.removesuffix(".npy"): array for member, array in zip(members, arrays, strict=True)}


def _read_array(path: Path, member: zipfile.ZipInfo) -> NDArray:
    damaged = ValueError(f"{member.filename!r} is damaged")
    size = member.file_size
    if member.header_offset < 0 or size > path.stat().st_size:
        raise damaged
    with path.open("rb") as file:
        file.seek(member.header_offset)
        start = file.read(_LOCAL_HEADER.size)
        if len(start) < _LOCAL_HEADER.size:
            raise damaged
        file.seek(sum(_LOCAL_HEADER.unpack(start)), os.SEEK_CUR)
        content = np.empty(size, np.uint8)
        if file.readinto(content.data) != size or zlib.crc32(content.data) != member.CRC:
            raise damaged
    head = io.BytesIO(content[:_LONGEST_HEAD].tobytes())
    version = npy.read_magic(head)
    shape, fortran_order, dtype = npy.read_array_header_1_0(head)
    if version != (1, 0) or fortran_order or dtype.hasobject:
        raise damaged
    return content[head.tell() :].view(dtype).reshape(shape)
