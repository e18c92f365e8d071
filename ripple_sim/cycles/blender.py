"""The process of Blender: which Python runs it, and frames as they come from it."""

from __future__ import annotations

import functools
import importlib.resources
import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import VideoError

PYTHON = "RIPPLE_SIM_BPY_PYTHON"
OLDEST = (5, 0)  # bpy before it has other names for what the importer of USD is told
_LAST = 300  # characters of what a process said last
_ADVICE = (
    "on Python 3.13 install it with: pip install 'ripple-sim[cycles]'; otherwise give it an environment of its own "
    f"(python3.11 -m venv blender; blender/bin/pip install 'bpy>=5.0') and set {PYTHON}=blender/bin/python"
)


def python_with_bpy() -> str:
    """Python that can import bpy: the one that the environment names, or this one.

    Raises
    ------
    VideoError
        If there is none, its bpy is too old, or cannot be imported.
    """
    named = os.environ.get(PYTHON)
    if named:
        if not os.access(named, os.X_OK):
            raise VideoError(f"{PYTHON} is {named!r}, which cannot be run; name a Python that has bpy")
    elif importlib.util.find_spec("bpy") is None:
        raise VideoError(f"the renderer cycles needs bpy, which is not installed; {_ADVICE}")
    python = named or sys.executable
    version = _version_of_bpy(python)
    if version < OLDEST:
        found, oldest = (".".join(map(str, each)) for each in (version, OLDEST))
        raise VideoError(f"{python} has bpy {found}; valid is {oldest} or later: {_ADVICE}")
    return python


@functools.cache  # asking takes most of a second
def _version_of_bpy(python: str) -> tuple[int, ...]:
    code = "import bpy; print(*bpy.app.version)"
    asked = subprocess.run([python, "-c", code], capture_output=True, text=True, errors="replace", check=False)
    last = (asked.stdout if asked.returncode == 0 else asked.stderr).strip().splitlines()[-1:]
    try:
        return tuple(map(int, last[0].split()))
    except (IndexError, ValueError):
        reason = "".join(last)[:_LAST] or f"status {asked.returncode}"
        raise VideoError(f"{python} cannot import bpy: {reason}; {_ADVICE}") from None


def frames_of_cycles(python: str, settings: dict[str, Any], folder: Path) -> Iterator[NDArray[np.float32]]:
    """Linear frames [height, width, 3], in their order, from a process of Blender's own.

    Parameters
    ----------
    python : str
        From `python_with_bpy`.
    settings : dict
        What blender_process.py reads.
    folder : Path
        For the files that pass between the processes.

    Raises
    ------
    VideoError
        If the process ends before the last frame.
    """
    told, errors = folder / "settings.json", folder / "blender.log"
    told.write_text(json.dumps({**settings, "folder": str(folder)}), encoding="utf-8")
    place = {**os.environ, "TMPDIR": str(folder)}  # Blender leaves folders behind where temporary files go
    script = importlib.resources.files(__package__).joinpath("blender_process.py")
    with (
        importlib.resources.as_file(script) as path,
        errors.open("wb") as log,
        subprocess.Popen([python, str(path), str(told)], stdout=subprocess.PIPE, stderr=log, env=place) as process,
    ):
        try:
            assert process.stdout is not None
            for number in range(settings["frames"]):
                _wait_for(number, process, errors)
                file = folder / f"{number}.npy"
                yield np.load(file)
                file.unlink()
        finally:
            process.terminate()


def _wait_for(number: int, process: subprocess.Popen, errors: Path) -> None:
    """Read what the process says until it has made a frame; the rest is Blender's own."""
    last = ""
    for line in process.stdout or ():
        text = line.decode(errors="replace").strip()
        if text == f"frame {number}":
            return
        last = text or last
    said = errors.read_text(errors="replace").strip().splitlines()
    reason = (said[-1] if said else last)[:_LAST] or "without a word"
    raise VideoError(f"Blender ended before frame {number} with status {process.wait()}: {reason}")
