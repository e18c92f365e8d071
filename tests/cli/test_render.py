"""Output of the program: progress on terminals alone, completion, tables of materials."""

import io
import json
import math
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numba
import numpy as np
import pytest
from programs import PROGRAMS
from scene_files import write_scene

from ripple_sim.cli import frame_progress, main as cli, reports
from ripple_sim.solver import compile_clock
from ripple_sim.solver.layouts.cube.convention import check_memory
from ripple_sim.solver.operator import PRESETS


def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """The text that the program prints on a terminal from now on."""
    told = io.StringIO()
    told.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(sys, "stderr", told)
    return told


def piped(monkeypatch: pytest.MonkeyPatch, seconds: float) -> list[str]:
    """What a pipe gets of a job of 200 frames that takes some seconds."""
    pipe = io.StringIO()
    clock = iter(np.linspace(0.0, seconds, 201))
    monkeypatch.setattr(sys, "stderr", pipe)
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    now = [next(clock)]
    with frame_progress("renderer") as report:
        for done in range(1, 201):
            now[0] = next(clock)
            report(done, 200)
    return pipe.getvalue().splitlines()


def test_a_pipe_stays_silent_while_a_job_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    assert piped(monkeypatch, 9.0) == []


def test_a_pipe_gets_a_line_at_each_tenth_of_a_long_job(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = piped(monkeypatch, 100.5)
    assert lines[0] == "ripple-sim: 10 % done, 20 of 200 frames"
    assert lines[-1] == "ripple-sim: 100 % done, 200 of 200 frames"
    assert len(lines) == 10


def test_a_terminal_shows_title_and_frames_done(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    told = terminal(monkeypatch)
    with frame_progress("llvmpipe [red] (LLVM 15), waves cpu") as report:
        report(3, 120)
        report(60, 120)
    assert all(
        each in told.getvalue() for each in ("llvmpipe [red] (LLVM 15), waves cpu", "60/120")
    )
    assert capsys.readouterr().out == ""


def test_compilation_is_reported_with_its_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    told = terminal(monkeypatch)
    kernels = "ripple_sim.solver.backends.step_kernels"
    monkeypatch.setattr("ripple_sim.solver.compile_clock.compiling", lambda: kernels)
    times = {kernels: 11.6, "ripple_sim.solver.texels.stencil": 3.0}
    monkeypatch.setattr("ripple_sim.solver.compile_clock.compile_times", lambda: times)
    with frame_progress("renderer", 120):
        pass
    assert all(
        each in told.getvalue() for each in ("compiling the wave step (once): 12 s", "0/120")
    )


def test_long_work_is_logged_and_printed_as_a_line(monkeypatch, capsys, caplog) -> None:
    monkeypatch.setattr(compile_clock._listener, "seconds", {"ripple_sim.solver": 2.1})
    monkeypatch.setattr(compile_clock._listener, "named", {"the atlas"})

    def run(self: object) -> None:
        check_memory(1000)
        for i in range(2):
            numba.njit(lambda x, i=i: x + i)(1)  # which is not kept

    monkeypatch.setattr(reports.InfoCommand, "run", run)
    assert cli.main(["info"]) == 0
    atlas, compiling = capsys.readouterr().err.splitlines()
    assert atlas == (
        "ripple-sim: an atlas of resolution 1000 has about 6 million texels, which take 30 s "
        "or "
        "more"
    )
    # of the two kernels the first names what both compute, here this test
    assert compiling == (
        f"ripple-sim: compiling {__name__} for this machine, once; later runs load it"
    )
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 2


def test_an_error_passes_through_the_progress_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal(monkeypatch)
    with pytest.raises(KeyboardInterrupt), frame_progress("renderer"):
        raise KeyboardInterrupt


def completed(script: Path, line: str) -> set[str]:
    """What bash offers for the last word of a line."""
    words = ["bash", "--norc", PROGRAMS / "complete.bash", script, *line.split(" ")]
    result = subprocess.run(words, capture_output=True, text=True, check=True)
    return {word.strip() for word in result.stdout.split()}


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_bash_completes_commands_options_and_choices(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out)
    for line, offered in (
        ("ripple-sim re", {"render"}),
        ("ripple-sim vi", {"view"}),
        ("ripple-sim render --dur", {"--duration"}),
        ("ripple-sim view --bench", {"--benchmark"}),
        ("ripple-sim render --backend c", {"cpu"}),
    ):
        assert completed(script, line) == offered


def test_zsh_gets_a_script_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["completion", "zsh"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("#compdef ripple-sim")
    assert "render" in out
    assert err == ""


def test_every_material_is_listed_with_source_speed_and_decay(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert cli.main(["materials", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told) == list(PRESETS)
    q = 2 * math.pi / 0.05
    skin = told["drum-skin"]
    damping = skin["parameters"]["damping"] / 2
    expected = math.sqrt(3990 / 0.262 - (damping / q) ** 2)
    assert skin["speed [m/s]"] == pytest.approx(expected)
    assert skin["decay [s]"] == pytest.approx(1 / damping)
    assert all(row["source"] and row["valid"] for row in told.values())
    assert cli.main(["materials"]) == 0
    assert "gelatine-5" in capsys.readouterr().out


@pytest.mark.parametrize("number", ["nan", "inf", "1e300"])
@pytest.mark.parametrize("place", ["gravity", "size", "body"])
def test_a_number_out_of_range_in_an_mjcf_is_one_line(
    refusal, tmp_path: Path, number: str, place: str
) -> None:
    """Not MuJoCo's warning and ours, nor NumPy's of what they lead to."""
    numbers = {"gravity": "-9.81", "size": "0.3", "body": "0.7"} | {place: number}
    model = f"""<mujoco><option gravity="0 0 {numbers["gravity"]}"/><worldbody>
        <geom name="egg" type="ellipsoid" size="0.4 {numbers["size"]} 0.3"/>
        <body pos="0 0 {numbers["body"]}"><freejoint/><geom size="0.06"/></body></worldbody>
        </mujoco>"""
    scene = write_scene(
        tmp_path, model, 'model = "scene.xml"\n[[ripple]]\ngeom = "egg"\nresolution = 8\n'
    )
    message = refusal("render", str(scene), "-o", str(tmp_path / "o.mp4"), "--duration", "0.1")
    assert re.search(
        r"must (be a number|hold numbers) up to 1e\+1.*(nan|inf|1e\+300)|MuJoCo refuses .*nan",
        message,
    )
