"""Progress is drawn on a terminal alone, and everything written to it is taken literally."""

import io
import sys

import pytest

from ripple_sim.cli import render
from ripple_sim.cli.render import frame_progress


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


def test_what_is_being_compiled_is_told_with_its_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(sys, "stderr", Terminal())
    kernels = "ripple_sim.solver.backends.kernels"
    monkeypatch.setattr("ripple_sim.solver.kernel.compiling", lambda: kernels)
    times = {kernels: 11.6, "ripple_sim.solver.texels.stencil": 3.0}
    monkeypatch.setattr("ripple_sim.solver.kernel.compile_times", lambda: times)
    with frame_progress("renderer", 120):
        pass
    text = sys.stderr.getvalue()
    assert "compiling the wave step (once): 12 s" in text
    assert "0/120" in text


@pytest.mark.parametrize(
    ("module", "stage"),
    [
        ("ripple_sim.solver.waves.load", "loads and height maps"),
        ("ripple_sim.solver.texels.stencil", "the atlas"),
        ("ripple_sim.coupling.patches", "the contacts"),
        ("my_kernels", "my_kernels"),
    ],
)
def test_kernels_are_told_by_what_they_do(module: str, stage: str) -> None:
    assert render._stage(module) == stage


def test_an_error_goes_on_through_the_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with pytest.raises(KeyboardInterrupt), frame_progress("renderer"):
        raise KeyboardInterrupt
