"""Files that appear complete or not at all, images to be read, and the memory that is left for either.

What cannot fit into memory is refused before it is begun: past a cgroup's limit the system kills a process without a
word, so only a look beforehand can name them. Images are read with pillow's limit against decompression bombs.
"""

from __future__ import annotations

import contextlib
import errno
import math
import os
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

from .errors import RippleError, shown

# Errors of the system that another name would have avoided.
OF_THE_NAME = (errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EINVAL, errno.ELOOP)

# Those of them that hold in every folder.
NO_NAME = (errno.ENAMETOOLONG, errno.ELOOP)

# Errors of the disk, which no other input would have avoided.
OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

# What is written beside a file before it takes its name has a longer one.
_LONGEST_SUFFIX = ".0123456789.part"


def final_path(path: Path) -> Path:
    """Where a path to be written leads, its symbolic links followed.

    Raises `OSError` if links lead in a circle, or the name is too long for the system, or too long to be written beside
    first.
    """
    final = Path(os.path.realpath(path))
    if final.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    try:
        final.with_name(final.name + _LONGEST_SUFFIX).lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise OSError(error.errno, error.strerror, str(path)) from error
    return final


@contextlib.contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, renamed to `path` at the end, removed after an exception.

    Symbolic links are followed, missing folders made. Raises `OSError` if the path exists and is not a regular file
    (renaming would destroy a device, say), or cannot be written.
    """
    path = final_path(path)
    if path.exists() and not path.is_file():
        raise FileExistsError(0, "it exists and is not a regular file")
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


# What is smaller always fits, and costs no look [bytes].
_SMALL = 32e6

# By the controller of a cgroup, which in version 2 has no name: the files of its limit and of what is taken.
_CGROUPS = {"": ("memory.max", "memory.current"), "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes")}


def require_memory(error: type[RippleError], need: float, what: str, advice: str) -> None:
    """Raise an error if something needs more memory [bytes] than is left, naming both and what sets the limit."""
    if need < _SMALL:
        return
    left, by = min(rooms(), default=(math.inf, ""))
    if need > left:
        raise error(f"{what} takes {_shown(need)} of memory, but {by} leaves {_shown(left)}; {advice}, or allow more")


def rooms(root: Path = Path("/")) -> Iterator[tuple[float, str]]:
    """What each limit leaves [bytes], and its name: the machine's free memory, `ulimit -v`, the cgroup's limits."""
    free = _table(root / "proc/meminfo")
    if "MemAvailable" in free:
        yield free["MemAvailable"] + free.get("SwapFree", 0.0), "the machine's free memory"
    if resource is not None and (most := resource.getrlimit(resource.RLIMIT_AS)[0]) != resource.RLIM_INFINITY:
        used = _table(root / "proc/self/status")
        yield most - used.get("VmSize", 0.0), f"the limit of the address space (ulimit -v, {_shown(most)})"
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controller, name = line.split(":", 2)
        if controller not in _CGROUPS:
            continue
        (limit, usage), top = _CGROUPS[controller], root / "sys/fs/cgroup" / controller
        # its own limits and those of the groups above it; cached files, which make room, are not counted
        for folder in (top / name.strip("/"), *(top / name.strip("/")).parents):
            if not folder.is_relative_to(top):
                break
            allowed, taken = _text(folder / limit).strip(), _text(folder / usage).strip()
            if allowed.isdigit() and taken.isdigit():
                cached = _table(folder / "memory.stat", scale=1).get("inactive_file", 0.0)
                yield int(allowed) - int(taken) + cached, f"the memory limit of the cgroup ({_shown(int(allowed))})"


def _table(path: Path, scale: int = 1024) -> dict[str, float]:
    """The numbers of a file of names and numbers, by name."""
    rows = (line.replace(":", " ").split() for line in _text(path).splitlines())
    return {row[0]: float(row[1]) * scale for row in rows if len(row) > 1 and row[1].isdigit()}


def _text(path: Path) -> str:
    """The text of a file, or nothing where there is none, as on other systems."""
    with contextlib.suppress(OSError):
        return path.read_text()
    return ""


def _shown(size: float) -> str:
    return f"{max(size, 0) / 1e9:.2f} GB"


# Of a pixel while an image is decoded, converted and uploaded [bytes].
_PIXEL = 12


def read_image(
    error: type[RippleError], source: str | Path | Image.Image, what: str, mode: Callable[[str], str]
) -> NDArray:
    """Pixels of an image file, or of an image that pillow has opened but perhaps not read.

    Parameters
    ----------
    error : type
        What is raised.
    source : path or PIL.Image.Image
    what : str
        What the image is, for messages.
    mode : callable
        From the file's mode, as pillow names it, to the one that is wanted.

    Returns
    -------
    array [height, width] or [height, width, channels], top row first

    Raises
    ------
    RippleError
        If the file cannot be read, has more pixels than pillow allows, or these do not fit into memory.
    """
    image = open_image(error, source, what)
    try:
        return np.asarray(image.convert(mode(image.mode)))
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{what} {shown(str(source))} cannot be read: {problem}") from problem


def open_image(error: type[RippleError], source: str | Path | Image.Image, what: str) -> Image.Image:
    """The image of a file, as pillow opens it: nothing but its head is read; see `read_image`."""
    name = f"{what} {shown(str(source))}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # that half of the limit is reached
            image = source if isinstance(source, Image.Image) else _opened(source)
    except Image.DecompressionBombError as bomb:
        raise error(f"{name} cannot be read: {bomb} Scale it down, or save it as a JPEG (baseline)") from bomb
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{name} cannot be read: {problem}") from problem
    width, height = image.size
    require_memory(error, _PIXEL * width * height, f"{name} of {width}x{height} pixels", "scale it down")
    return image


def _opened(path: str | Path) -> Image.Image:
    """An image file; a JPEG beyond pillow's limit at the half, quarter or eighth of its size at which it is below.

    It is decoded at that size, row by row. A progressive one, or a PNG, would be held whole meanwhile.
    """
    try:
        return Image.open(path)
    except Image.DecompressionBombError as bomb:
        try:
            image = JpegImageFile(path)
        except SyntaxError:  # it is no JPEG
            raise bomb from None
        width, height = image.size
        scales = [k for k in (2, 4, 8) if width * height <= k * k * 2 * (Image.MAX_IMAGE_PIXELS or 0)]
        if not scales or image.info.get("progressive"):
            image.close()
            raise
        image.draft(None, (width // scales[0], height // scales[0]))
        return image
