"""The memory that is left on this machine.

Work that does not fit into memory is refused before it begins. Beyond the limit of a cgroup, the
system kills a process without a message: only a check beforehand can name the limit.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

from .errors import RippleError

_UNCHECKED_BYTES = 32e6  # less memory than this always fits, and is not checked

# Files of a cgroup's limit and of its memory in use, by the cgroup's controller, which has no name in
# version 2.
_CGROUP_FILES = {
    "": ("memory.max", "memory.current"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes"),
}


def require_memory(error: type[RippleError], need: float, what: str, advice: str) -> None:
    """Raise an error if something needs more memory [bytes] than is left.

    The message names both amounts, and the limit.
    """
    if need < _UNCHECKED_BYTES:
        return
    room, limit_name = min(rooms(), default=(math.inf, ""))
    if need > room:
        raise error(
            f"{what} takes {_shown(need)} of memory, but {limit_name} leaves {_shown(room)}; "
            f"{advice}, or allow more"
        )


def rooms(root: Path = Path("/")) -> Iterator[tuple[float, str]]:
    """The memory that each limit leaves [bytes], and the name of the limit.

    The limits are the machine's free memory, `ulimit -v`, and the limits of the cgroup.
    """
    free = _table(root / "proc/meminfo")
    if "MemAvailable" in free:
        yield free["MemAvailable"] + free.get("SwapFree", 0.0), "the machine's free memory"
    if resource is not None:
        address_space, _ = resource.getrlimit(resource.RLIMIT_AS)
        if address_space != resource.RLIM_INFINITY:
            used = _table(root / "proc/self/status").get("VmSize", 0.0)
            name = f"the limit of the address space (ulimit -v, {_shown(address_space)})"
            yield address_space - used, name
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controller, name = line.split(":", 2)
        if controller in _CGROUP_FILES:
            yield from _cgroup_rooms(root / "sys/fs/cgroup" / controller, name, controller)


def _cgroup_rooms(top: Path, name: str, controller: str) -> Iterator[tuple[float, str]]:
    """The memory that the limits of a cgroup and of the groups above it leave [bytes]."""
    limit_file, usage_file = _CGROUP_FILES[controller]
    own_folder = top / name.strip("/")
    for folder in (own_folder, *own_folder.parents):
        if not folder.is_relative_to(top):
            break
        limit = _text(folder / limit_file).strip()
        usage = _text(folder / usage_file).strip()
        if limit.isdigit() and usage.isdigit():
            # cached files make room, and do not count
            cached = _table(folder / "memory.stat", scale=1).get("inactive_file", 0.0)
            room = int(limit) - int(usage) + cached
            yield room, f"the memory limit of the cgroup ({_shown(int(limit))})"


def _table(path: Path, scale: int = 1024) -> dict[str, float]:
    """The numbers of a file of names and numbers, by name, times `scale`."""
    rows = (line.replace(":", " ").split() for line in _text(path).splitlines())
    return {row[0]: float(row[1]) * scale for row in rows if len(row) > 1 and row[1].isdigit()}


def _text(path: Path) -> str:
    """The text of a file, or nothing where there is no such file, as on other systems."""
    with contextlib.suppress(OSError):
        return path.read_text()
    return ""


def _shown(size: float) -> str:
    """A number of bytes in the words of a message."""
    return f"{max(size, 0) / 1e9:.2f} GB"
