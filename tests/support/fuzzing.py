"""Fuzzing: its length, the strange values and damages, and the allowed outcomes."""

import contextlib
import copy
import io
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, settings, strategies as st
from hypothesis.database import DirectoryBasedExampleDatabase
from unfinished_videos import contents

from ripple_sim.cli import main as cli
from ripple_sim.solver import RippleError

# `make fuzz` sets it; what it finds is kept in a folder that git ignores, and tried first the next
# time. The tests take a few examples, always the same.
EXAMPLES = int(os.environ.get("RIPPLE_SIM_FUZZ", "0"))


def fuzzed_by(usual: int, share: float = 1.0) -> settings:
    """Settings for a number of examples in the tests, and for a share of `make fuzz`."""
    return settings(
        max_examples=max(1, round(EXAMPLES * share)) if EXAMPLES else usual,
        derandomize=not EXAMPLES,
        database=DirectoryBasedExampleDatabase(".hypothesis/fuzz") if EXAMPLES else None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


fuzzed = fuzzed_by(100)

LIMITS = [0, -1, 10**400, -(10**400), 1e-300, 1e300, float("nan"), float("inf"), True]
NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True), st.integers(), st.sampled_from(LIMITS)
)
STRANGE = ["", "\0", "a" * 5000, "../..", "/dev/null", "\ud800", "'\n\""]
TEXTS = st.one_of(st.text(max_size=20), st.sampled_from(STRANGE))
SCALARS = st.one_of(NUMBERS, TEXTS, st.none(), st.booleans())
VALUES = st.recursive(
    SCALARS, lambda x: st.lists(x, max_size=4) | st.dictionaries(TEXTS, x, max_size=3), max_leaves=6
)


def outcome(call: Callable[[], Any]) -> Any:
    """What a call returns, or its `RippleError`, whose message must be of a readable length.

    Other errors pass.
    """
    try:
        return call()
    except RippleError as error:
        assert str(error).strip()
        return error


def command(*words: object) -> int:
    """Exit status of the program in this process; a failure prints one line."""
    err = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
        status = cli.main([*map(str, words)])
    lines = err.getvalue().splitlines()
    assert status in (0, 1, 2)
    assert all(line.startswith("ripple-sim: ") and len(line) < 900 for line in lines), lines
    news = ("ripple-sim: warning: ", "ripple-sim: compiling ")
    # a slow machine prints the progress of a long job
    others = [line for line in lines if not line.startswith(news) and "% done, " not in line]
    assert len(others) == (status > 0), lines
    return status


def places(value: Any, path: tuple = ()) -> list[tuple]:
    """Paths to all values in a table."""
    inner = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    return [path, *(place for key, each in inner for place in places(each, (*path, key)))]


def put(table: dict[str, Any], place: tuple, value: Any) -> dict[str, Any]:
    """A copy of a table with a value at a path."""
    at = table = copy.deepcopy(table)
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return table


CHANGES = st.lists(st.tuples(st.floats(0, 1), st.binary(max_size=6)), max_size=4)


def changed(content: bytes, changes: list[tuple[float, bytes]]) -> bytes:
    """Bytes with others at some places, each a share of the length."""
    for place, new in changes:
        at = int(place * len(content))
        content = content[:at] + new + content[at + len(new) :]
    return content


@contextlib.contextmanager
def home_of_others() -> Iterator[Path]:
    """A folder for one trial. It contains a folder of another person, which must not change."""
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        (home / "thesis").mkdir()
        for mine in ("chapter.tex", "frame_00000.png", "000000.json", "000001.log"):
            (home / "thesis" / mine).write_text("mine")
        before = contents(home / "thesis")
        yield home
        assert contents(home / "thesis") == before


MARK = '"made by ripple-sim"'
JSON = ["[]", "{}", "null", "5", MARK, f"[{MARK}]", f"{{{MARK}: 1}}", "[" * 9999]
SHARES = st.floats(0, 1, exclude_max=True)
KINDS = st.sampled_from(
    ["empty", "cut", "flip", "missing", "folder", "link", "json", "swap", "digit"]
)
DAMAGES = st.lists(st.tuples(SHARES, KINDS, SHARES), min_size=1, max_size=3)


def damage(folder: Path, damages: list[tuple[float, str, float]]) -> None:
    """Spoil files of a folder. Each damage says which file, how, and where in the file.

    Links lead to a folder `thesis` beside.
    """
    for which, kind, where in damages:
        paths = sorted(path for path in folder.rglob("*") if not path.is_symlink())
        if not paths:
            return
        path = paths[int(which * len(paths))]
        other = paths[int(where * len(paths))]
        content = path.read_bytes() if path.is_file() else b"text"
        taken = other.read_bytes() if other.is_file() else b"\xff\0"
        at = int(where * len(content))
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        if kind == "link":
            mine = sorted((folder.parent / "thesis").iterdir())
            path.symlink_to(
                [folder.parent / "thesis", folder / "nowhere", *mine][int(where * (len(mine) + 2))]
            )
        elif kind == "folder":
            (path / "inner").mkdir(parents=True)
        elif kind != "missing":
            flipped = (
                content[:at]
                + bytes(each ^ 1 << at % 8 for each in content[at : at + 1])
                + content[at + 1 :]
            )
            digit = content[:at] + re.sub(rb"\d", b"%d" % (at % 10), content[at:], count=1)
            text = JSON[int(where * len(JSON))].encode()
            new = {
                "empty": b"",
                "cut": content[:at],
                "flip": flipped,
                "json": text,
                "swap": taken,
                "digit": digit,
            }
            path.write_bytes(new[kind])
