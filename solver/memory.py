"""The memory that is left on this machine.

Work that does not fit into memory is refused before it begins. Beyond the limit of a cgroup, the
system kills a process without a message: only a check beforehand can name the limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

from .cgroup import cgroup_folders, text_of
from .errors import RippleError

_UNCHECKED_BYTES = 32e6  # less memory than this always fits, and is not checked

# Files of a cgroup's limit and of its memory in use, in versions 1 and 2.
_FILES = ("memory.max", "memory.current")
_FILES_OF_VERSION_1 = ("memory.limit_in_bytes", "memory.usage_in_bytes")


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


def address_space_limit() -> float:
    """The limit of this process's address space [bytes], `ulimit -v`; infinite without one."""
    if resource is None:
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else limit


def rooms(root: Path = Path("/")) -> Iterator[tuple[float, str]]:
    """The memory that each limit leaves [bytes], and the name of the limit.

    The limits are the machine's free memory, `ulimit -v`, and the limits of the cgroup.
    """
    free = _table(root / "proc/meminfo")
    if "MemAvailable" in free:
        yield free["MemAvailable"] + free.get("SwapFree", 0.0), "the machine's free memory"
    address_space = address_space_limit()
    if address_space < math.inf:
        used = _table(root / "proc/self/status").get("VmSize", 0.0)
        name = f"the limit of the address space (ulimit -v, {_shown(address_space)})"
        yield address_space - used, name
    for folder, is_first_version in cgroup_folders("memory", root):
        limit_file, usage_file = _FILES_OF_VERSION_1 if is_first_version else _FILES
        limit = text_of(folder / limit_file).strip()
        usage = text_of(folder / usage_file).strip()
        if limit.isdigit() and usage.isdigit():
            # cached files make room, and do not count
            cached = _table(folder / "memory.stat", scale=1).get("inactive_file", 0.0)
            room = int(limit) - int(usage) + cached
            yield room, f"the memory limit of the cgroup ({_shown(int(limit))})"


def _table(path: Path, scale: int = 1024) -> dict[str, float]:
    """The numbers of a file of names and numbers, by name, times `scale`."""
    rows = (line.replace(":", " ").split() for line in text_of(path).splitlines())
    return {row[0]: float(row[1]) * scale for row in rows if len(row) > 1 and row[1].isdigit()}


def _shown(size: float) -> str:
    """A number of bytes in the words of a message."""
    return f"{max(size, 0) / 1e9:.2f} GB"
