"""Command lines of any words end with status 0 or 2; what is refused is one line."""

import contextlib
import io

import pytest
from fuzzing import NUMBERS, TEXTS, fuzzed
from hypothesis import given
from hypothesis import strategies as st

from ripple_sim.cli import main as cli
from ripple_sim.cli.parser import COMMANDS

OPTIONS = [
    *("-o", "--output", "--size", "--fps", "--duration", "--resolution", "--seed", "--backend", "--layout"),
    *("--overlay", "--overwrite", "--resume", "--port", "--host", "--json", "--help", "--up", "--bodies"),
    *("--shutter", "--", "-", "-x"),
]
WORDS = st.one_of(st.sampled_from(OPTIONS), NUMBERS.map(lambda value: str(value)[:300]), TEXTS, st.just("sphere"))


@pytest.fixture(autouse=True, scope="module")
def _nothing_runs():
    with pytest.MonkeyPatch.context() as patch:
        for command in {*COMMANDS.values()}:
            if hasattr(command, "run"):
                patch.setattr(command, "run", lambda self: None)
        yield


@fuzzed
@given(st.sampled_from([*COMMANDS, "", "rendr"]), st.lists(WORDS, max_size=6))
def test_any_words(command: str, words: list[str]) -> None:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = cli.main([command, *words])
    assert status in (0, 2)
    if status:
        assert err.getvalue().startswith("ripple-sim: ")
        assert err.getvalue().count("\n") == 1
        assert len(err.getvalue()) < 900
