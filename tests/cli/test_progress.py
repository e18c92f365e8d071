"""Progress is drawn on a terminal alone, and everything written to it is taken literally."""

import io
import sys

import pytest

from ripple_sim.cli.progress import frame_progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_pipe_stays_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = io.StringIO()
    monkeypatch.setattr(sys, "stderr", pipe)
    with frame_progress("renderer") as report:
        assert report is None
    assert pipe.getvalue() == ""


def test_a_terminal_shows_title_and_frames_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with frame_progress("llvmpipe [red] (LLVM 15), waves cpu") as report:
        report(3, 120)
        report(60, 120)
    text = terminal.getvalue()
    assert "llvmpipe [red] (LLVM 15), waves cpu" in text
    assert "60/120" in text
    assert capsys.readouterr().out == ""


def test_an_error_goes_on_through_the_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with pytest.raises(KeyboardInterrupt), frame_progress("renderer"):
        raise KeyboardInterrupt
