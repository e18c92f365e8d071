"""The files that an MJCF names, looked at before MuJoCo opens them: it would wait for ever for one that is a FIFO."""

from __future__ import annotations

import stat
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from xml.parsers import expat

from ripple_sim.errors import SceneError
from ripple_sim.solver.files import open_image

# Attributes of <compiler> that name folders, and those that name files.
_FOLDERS = ("meshdir", "texturedir", "assetdir")
_FILES = ("file", "filename", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")

_BAD_CHARACTER = expat.errors.codes[expat.errors.XML_ERROR_BAD_CHAR_REF]

# Elements whose PNG files MuJoCo reads whole, however large.
_IMAGES = ("texture", "hfield")


def check_files(path: Path) -> None:
    """Make sure that an MJCF and all that it includes or names are regular files, as far as they exist.

    Its images must not be larger than pillow allows.

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
        except ElementTree.ParseError as error:
            if error.code == _BAD_CHARACTER:
                line, column = error.position
                raise SceneError(
                    f"the model {str(xml)!r} refers to an unknown character, at line {line}, column {column}: "
                    "MuJoCo would cut the text there; valid are names without a NUL"
                ) from error
            continue  # MuJoCo says what is wrong
        except (OSError, ValueError, LookupError, RecursionError):
            continue  # likewise
        folders |= {path.parent / each.get(name, "") for each in root.iter("compiler") for name in _FOLDERS}
        for element in root.iter():
            for name in filter(None, map(element.get, _FILES)):
                found = [place for folder in {*folders, xml.parent} if _exists(place := folder / name)]
                if element.tag == "include":
                    waiting += found
                elif element.tag in _IMAGES:
                    for place in found:
                        if place.suffix.lower() == ".png":
                            open_image(SceneError, place, element.tag).close()


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
