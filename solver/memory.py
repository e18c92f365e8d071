"""The memory that is left.

What cannot fit into memory is refused before it begins: past a cgroup's limit the system kills a
process without a word, so only a look beforehand can name the limit.
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

# What is smaller always fits, and costs no look [bytes].
_SMALL = 32e6


# By the controller of a cgroup, which in version 2 has no name: the files of its limit and of what
# is taken.
_CGROUPS = {
    "": ("memory.max", "memory.current"),
    "memory": ("memory.limit_in_bytes", "memory.usage_in_bytes"),
}


def require_memory(error: type[RippleError], need: float, what: str, advice: str) -> None:
    """Raise an error if something needs more memory [bytes] than is left, naming both and what sets the limit."""
    if need < _SMALL:
        return
    left, by = min(rooms(), default=(math.inf, ""))
    if need > left:
        raise error(
            f"{what} takes {_shown(need)} of memory, but {by} leaves {_shown(left)}; {advice}, or "
            f"allow more"
        )


def rooms(root: Path = Path("/")) -> Iterator[tuple[float, str]]:
    """What each limit leaves [bytes], and its name: the machine's free memory, `ulimit -v`, the cgroup's limits."""
    free = _table(root / "proc/meminfo")
    if "MemAvailable" in free:
        yield free["MemAvailable"] + free.get("SwapFree", 0.0), "the machine's free memory"
    if (
        resource is not None
        and (most := resource.getrlimit(resource.RLIMIT_AS)[0]) != resource.RLIM_INFINITY
    ):
        used = _table(root / "proc/self/status")
        yield (
            most - used.get("VmSize", 0.0),
            f"the limit of the address space (ulimit -v, {_shown(most)})",
        )
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controller, name = line.split(":", 2)
        if controller not in _CGROUPS:
            continue
        (limit, usage) = _CGROUPS[controller]
        top = root / "sys/fs/cgroup" / controller
        # its own limits and those of the groups above it; cached files, which make room, are not
        # counted
        for folder in (top / name.strip("/"), *(top / name.strip("/")).parents):
            if not folder.is_relative_to(top):
                break
            allowed = _text(folder / limit).strip()
            taken = _text(folder / usage).strip()
            if allowed.isdigit() and taken.isdigit():
                cached = _table(folder / "memory.stat", scale=1).get("inactive_file", 0.0)
                yield (
                    int(allowed) - int(taken) + cached,
                    f"the memory limit of the cgroup ({_shown(int(allowed))})",
                )


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
