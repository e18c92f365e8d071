"""`read_toml`: a TOML file as a table, whatever the file holds."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from ripple_sim.errors import SceneError

# Parts of one dotted key: tomllib's time grows with their square, and ours have four.
_MOST_PARTS = 100


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
    what : str
        What the file is, for messages.

    Raises
    ------
    SceneError
        If it cannot be read or is not valid TOML.
    """
    name = f"{what} {str(path)!r}"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise SceneError(f"{name} does not exist; give the path of a TOML file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{name} cannot be read: {error}") from error
    parts = max(len(re.findall(r"[^.\s]\s*\.", line)) + 1 for line in re.split(r"[=,\n]", text))
    if parts > _MOST_PARTS:
        raise SceneError(f"{name} has a key of {parts} parts with dots between them; valid are at most {_MOST_PARTS}")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise SceneError(f"{name} is nested too deeply; its tables have four levels at most") from error
    except ValueError as error:  # also of a number with thousands of digits
        raise SceneError(f"{name} is not valid TOML: {error}") from error
