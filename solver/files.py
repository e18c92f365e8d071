"""What cannot fit into memory is refused before it is begun."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from .errors import RippleError

# What is smaller always fits, and costs no look [bytes].
_SMALL = 32e6

# By cgroup version: folder of the memory controller, and the files of its limit and of what is taken.
_CGROUPS = {
    2: ("", "memory.max", "memory.current"),
    1: ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
}


class Room(NamedTuple):
    """Memory that is left [bytes], and by what."""

    left: float
    by: str


def require_memory(error: type[RippleError], need: float, what: str, advice: str) -> None:
    """Raise an error if something needs more memory [bytes] than is left, naming both and what sets the limit."""
    if need < _SMALL:
        return
    room = min(rooms(), default=None)
    if room is not None and need > room.left:
        raise error(
            f"{what} takes {_shown(need)} of memory, but {room.by} leaves {_shown(room.left)}; {advice}, or allow more"
        )


def rooms(root: Path = Path("/")) -> Iterator[Room]:
    """What each limit leaves: the machine's free memory, the process's address space (`ulimit -v`), its cgroup's."""
    free = _table(root / "proc/meminfo")
    if "MemAvailable" in free:
        yield Room(free["MemAvailable"] + free.get("SwapFree", 0.0), "the machine's free memory")
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    used = _table(root / "proc/self/status")
    if most != resource.RLIM_INFINITY:
        yield Room(most - used.get("VmSize", 0.0), f"the limit of the address space (ulimit -v, {_shown(most)})")
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, name = line.split(":", 2)
        if controllers in ("", "memory"):
            yield from _of_cgroups(root, 1 if controllers else 2, name)


def _of_cgroups(root: Path, version: int, name: str) -> Iterator[Room]:
    """What the limits of a cgroup and of those above it leave; cached files, which make room, are not counted."""
    controller, limit, usage = _CGROUPS[version]
    top = root / "sys/fs/cgroup" / controller
    for folder in (top / name.strip("/"), *(top / name.strip("/")).parents):
        if not folder.is_relative_to(top):
            return
        most, used = _text(folder / limit).strip(), _text(folder / usage).strip()
        if most.isdigit() and used.isdigit():
            cached = _table(folder / "memory.stat", scale=1).get("inactive_file", 0.0)
            yield Room(int(most) - int(used) + cached, f"the memory limit of the cgroup ({_shown(int(most))})")


def _table(path: Path, scale: int = 1024) -> dict[str, float]:
    """The numbers of a file of names and numbers, by name."""
    rows = (line.replace(":", " ").split() for line in _text(path).splitlines())
    return {row[0]: float(row[1]) * scale for row in rows if len(row) > 1 and row[1].isdigit()}


def _text(path: Path) -> str:
    """The text of a file, or nothing where there is none, as on other systems."""
    try:
        return path.read_text()
    except OSError:
        return ""


def _shown(size: float) -> str:
    return f"{max(size, 0) / 1e9:.2f} GB"
