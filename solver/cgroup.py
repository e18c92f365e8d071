"""The cgroups that limit this process: where Linux keeps their limits as files."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path


def cgroup_folders(controller: str, root: Path = Path("/")) -> Iterator[tuple[Path, bool]]:
    """Folders of this process's cgroup and of the cgroups above it, and whether of version 1.

    In version 1 each controller, such as "memory" or "cpu", has cgroups of its own. In version 2
    one folder has the limits of all. There are no folders on other systems.
    """
    for line in text_of(root / "proc/self/cgroup").splitlines():
        _, controllers, name = line.split(":", 2)
        is_first_version = controllers != ""
        top = root / "sys/fs/cgroup"
        if is_first_version:
            if controller not in controllers.split(","):
                continue
            top /= controller
        own_folder = top / name.strip("/")
        for folder in (own_folder, *own_folder.parents):
            if not folder.is_relative_to(top):
                break
            yield folder, is_first_version


def text_of(path: Path) -> str:
    """The text of a file, or nothing where it cannot be read, as on other systems."""
    with contextlib.suppress(OSError):
        return path.read_text(encoding="utf-8", errors="replace")
    return ""
