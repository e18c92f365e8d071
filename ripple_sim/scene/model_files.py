"""The files that an MJCF names, looked at before MuJoCo opens them: it would wait for ever for one that is a FIFO."""

from __future__ import annotations

import stat
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from ripple_sim.errors import SceneError

# Attributes of <compiler> that name folders, and those that name files.
_FOLDERS = ("meshdir", "texturedir", "assetdir")
_FILES = ("file", "filename", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


def check_files(path: Path) -> None:
    """Make sure that an MJCF and all that it includes or names are regular files, as far as they exist.

    Raises
    ------
    SceneError
        Naming the file.
    """
    waiting, seen = [path], set()
    folders = {path.parent}
    while waiting:
        xml = waiting.pop()
        if xml in seen:
            continue
        seen.add(xml)
        try:
            root = ElementTree.parse(xml).getroot()
        except (OSError, ElementTree.ParseError, ValueError, LookupError, RecursionError):
            continue  # MuJoCo says what is wrong
        folders |= {path.parent / each.get(name, "") for each in root.iter("compiler") for name in _FOLDERS}
        for element in root.iter():
            for name in filter(None, map(element.get, _FILES)):
                found = [place for folder in {*folders, xml.parent} if _exists(place := folder / name)]
                if element.tag == "include":
                    waiting += found


def _exists(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return False
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise SceneError(
            f"the model names {str(path)!r}, which is not a regular file; a FIFO or a device cannot be read"
        )
    return stat.S_ISREG(mode)
