"""Tar files of finished scenes, as WebDataset reads them: files of one scene one after another, named by its number."""

from __future__ import annotations

import io
import re
import tarfile
from collections.abc import Iterable
from pathlib import Path

from ripple_sim.solver.files import atomic_write

NUMBER = re.compile(r"\d{6,}")


def member_name(number: int, name: str) -> str:
    """Name of a scene's file in a tar file: WebDataset takes what is before the first dot for the scene."""
    return f"{number:06d}.{name.replace('/', '.')}"


def times_of(tar: Path) -> Path:
    """The file that tells who made the scenes of a tar file and how long each took, which is not in their bytes."""
    return tar.with_suffix(".times.json")


def packed(tar: Path) -> set[int]:
    """Numbers of the scenes in a tar file."""
    return set(members(tar))


def members(tar: Path) -> dict[int, dict[str, tarfile.TarInfo]]:
    """The files in a tar file by their names, by scene."""
    found: dict[int, dict[str, tarfile.TarInfo]] = {}
    with tarfile.open(tar) as file:
        for member in file:
            number, name = member.name.split(".", 1)
            found.setdefault(int(number), {})[name] = member
    return found


def write_tar(tar: Path, files: Iterable[tuple[str, bytes]]) -> None:
    """Write a tar file of names and contents; it appears whole, and tells nothing of who wrote it and when."""
    with atomic_write(tar) as path, tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as file:
        for name, content in files:
            member = tarfile.TarInfo(name)
            member.size = len(content)
            file.addfile(member, io.BytesIO(content))
