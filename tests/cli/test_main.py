"""The program: quick help, one line for a mistake, exit statuses, nothing left behind."""

import os
import re
import signal
import subprocess
import sys
import warnings
from unittest.mock import Mock

import pytest
from programs import PROGRAMS, ended

import ripple_sim
from ripple_sim import bench
from ripple_sim.cli import main as cli, reports
from ripple_sim.errors import EncodingError, RippleWarning, SceneError
from ripple_sim.solver.errors import GLError


@pytest.mark.parametrize("command", [[], ["render"], ["drop"], ["atlas"], ["info"]])
def test_every_command_prints_its_help(capsys, command):
    assert cli.main([*command, "--help"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(" ".join(["usage: ripple-sim", *command]))
    assert err == ""


def test_the_version_is_that_of_the_package(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr() == (f"ripple-sim {ripple_sim.__version__}\n", "")


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "render, drop, export, batch, atlas, modes, info"),
        (["fly"], "there is no command 'fly'; commands are render, drop"),
        (["rendr"], r"there is no command 'rendr' \(did you mean render\?\)"),
        (["render", "duck", "-o", "x.mp4", "--sise", "3"], r"--sise, 3 \(did you mean --size\?\)"),
        (["render", "duck"], "--output"),
        (["render", "-o", "x.mp4"], "SCENE"),
        (["render", "duck", "-o", "x.mp4", "--colour", "red"], "--colour"),
        (
            ["render", "duck", "-o", "x.mp4", "--size", "big"],
            "--size: frame size .*1280x720, got 'big'",
        ),
        (["render", "duck", "-o", "x.mp4", "--resolution", "1.5"], "--resolution.*'1.5'"),
        (["render", "duck", "-o", "x.mp4", "--device", "gpu"], "--device.*'gpu'"),
        (["drop", "mesh.obj", "-o", "x.mp4", "--seed", "luck"], "--seed.*'luck'"),
        (
            ["atlas", "any.off", "--layout", "octahedron"],
            "it must be auto, cube or patches, got 'octahedron'",
        ),
    ],
)
def test_a_usage_error_names_the_argument_and_the_help(refusal, argv, named):
    line = refusal(*argv)
    assert re.search(named, line)
    assert line.rstrip().endswith(
        f"; see ripple-sim {argv[0]} --help" if len(argv) > 1 else "; see ripple-sim --help"
    )
    assert line.isascii()


def test_a_usage_error_reads_the_same_in_every_locale():
    words = ["render", "duck", "-o", "x.mp4", "--backend", "vulkan"]
    result = ended(
        "-m",
        "ripple_sim",
        *words,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "FORCE_COLOR": "1"},
    )
    said = "invalid choice 'vulkan' for argument '--backend'. Expected one of ('auto', 'gl', 'cpu')"
    assert (result.returncode, result.stderr) == (
        2,
        f"ripple-sim: {said}; see ripple-sim render --help\n",
    )


@pytest.mark.parametrize("command", ["render", "drop"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["-o", "clip.avi"], r"clip\.avi.*must be \.mp4"),
        (["-o", ".mp4"], r"\.mp4', which is not a file name"),
        (["-o", "x."], r"x\. ends in \.; it must be"),
        (["-o", "clip.mp4", "--size", "641x360"], "641x360.*even"),
        (["-o", "clip.gif", "--fps", "60"], "1 to 50 .*, got 60"),
        (["-o", "clip.mp4", "--size", "0x0"], r"size must be .*, got \(0, 0\)"),
    ],
)
def test_a_bad_output_is_refused_before_the_scene_is_read(
    tmp_path, monkeypatch, refusal, command, options, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken").touch()
    assert re.search(said, refusal(command, "broken", *options))
    assert list(tmp_path.iterdir()) == [tmp_path / "broken"]


def test_a_missing_folder_is_refused_before_the_viewer_opens(refusal):
    assert "there is no folder 'nowhere' for screenshots" in refusal(
        "view", "sphere", "--folder", "nowhere"
    )


def test_a_missing_device_is_an_error_of_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("ripple_sim.solver.gl.context._selected", None)  # put back after the test
    assert cli.main(["render", "sphere", "-o", str(tmp_path / "clip.mp4"), "--device", "77"]) == 1
    assert re.fullmatch(r"ripple-sim: no OpenGL .* on EGL device 77 .*\n", capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "argv",
    [
        ["view", "missing"],
        ["view", "missing.toml"],
        ["export", "missing", "-o", "run.usdc"],
        ["render", "no such scene", "-o", "clip.mp4", "--renderer", "cycles"],
        ["drop", "missing.obj", "-o", "frames", "--frame-format", "exr"],
        ["batch", "missing.toml", "-o", "batch"],
        ["atlas", "missing.obj", "--inside", "scan.nii"],
    ],
    ids=lambda argv: argv[0],
)
def test_a_missing_input_is_reported_before_a_missing_device(tmp_path, monkeypatch, refusal, argv):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for package in ("pyarrow", "OpenEXR", "nibabel"):
        monkeypatch.setitem(sys.modules, package, None)
    said = refusal(*argv)
    assert argv[1] in said
    assert "Errno" not in said
    assert list(tmp_path.iterdir()) == []


def noted(ending: BaseException) -> BaseException:
    ending.add_note("48 frames are kept")
    return ending


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (SceneError("geom 'x' is missing;\nadd it"), 2, "geom 'x' is missing; add it"),
        (GLError("no OpenGL"), 1, "no OpenGL"),
        (EncodingError("disk full"), 1, "disk full"),
        (MemoryError("9 TiB"), 1, "not enough memory: 9 TiB; ask for a lower resolution or size"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (noted(KeyboardInterrupt()), 130, "interrupted; 48 frames are kept"),
    ],
)
def test_the_exit_status_is_2_for_bad_input_and_1_for_other_errors(
    monkeypatch, capsys, error, status, line
):
    monkeypatch.setattr(reports.InfoCommand, "run", Mock(side_effect=error))
    assert cli.main(["info"]) == status
    assert capsys.readouterr().err == f"ripple-sim: {line}\n"


@pytest.mark.parametrize(
    ("words", "need"),
    [("render duck -o x.mp4", 2.4), ("export duck -o x.usda", 3.0), ("atlas a.obj", 1.2)],
)
def test_too_little_address_space_is_reported_at_the_start(tmp_path, words, need):
    """Later OpenBLAS, LLVM or Mesa run out of it, and end the process or blame something else."""
    code = f"ulimit -v 800000; {sys.executable} -m ripple_sim {words}"
    result = subprocess.run(
        ["bash", "--norc", "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    limit = "the limit (ulimit -v) is 0.82 GB; allow more"
    assert result.stderr == f"ripple-sim: this needs {need} GB of address space, but {limit}\n"
    assert result.returncode == 1


def test_an_unexpected_error_is_not_hidden(monkeypatch):
    monkeypatch.setattr(reports.InfoCommand, "run", Mock(side_effect=ZeroDivisionError))
    with pytest.raises(ZeroDivisionError):
        cli.main(["info"])


@pytest.mark.parametrize(
    ("number", "status", "word", "while_it_is"),
    [
        (signal.SIGINT, 130, "interrupted", "parsing"),
        (signal.SIGTERM, 143, "terminated", "running"),
    ],
)
def test_a_signal_while_modules_are_imported_ends_the_program_with_one_line(
    number, status, word, while_it_is
):
    environment = {**os.environ, "SIGNAL_ON_IMPORT": str(int(number))}
    program = PROGRAMS / "interrupt_info.py"
    result = ended(program, while_it_is, env=environment, timeout=300)
    assert (result.returncode, result.stderr) == (status, f"ripple-sim: {word}\n")


def test_a_warning_is_one_line_and_the_handler_is_restored(monkeypatch, capsys):
    def run(self):
        warnings.warn("the hull is\noff the surface", RippleWarning, stacklevel=1)

    before = warnings.showwarning
    monkeypatch.setattr(reports.InfoCommand, "run", run)
    assert cli.main(["info"]) == 0
    assert capsys.readouterr().err == "ripple-sim: warning: the hull is off the surface\n"
    assert warnings.showwarning is before


def test_help_loads_nothing_heavy():
    result = ended(PROGRAMS / "modules_of_help.py", check=True)
    assert result.stdout.splitlines()[-1] == "[]"


LONG = "a" * 5000


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        (["render", LONG, "-o", "x.mp4"], "there is no scene 'aaa"),
        (["render", "sphere", "-o", f"{LONG}.mp4"], "File name too long"),
        (
            ["render", "sphere", "-o", "x.mp4", "--size", "9" * 5000],
            "frame size must be WIDTHxHEIGHT",
        ),
        (["render", "sphere", "-o", "x\0.mp4"], "NUL"),
        (["render", "a\0", "-o", "x.mp4"], "NUL"),
        (["atlas", LONG], "File name too long"),
        (["atlas", "tetrahedron.obj", "-o", f"{LONG}.npz"], "File name too long"),
        (["atlas", "tetrahedron.obj", "--plot", f"{LONG}.png"], "File name too long"),
        (["drop", f"{LONG}.obj", "-o", "x.mp4"], "File name too long"),
        (["bench", LONG], "File name too long"),
    ],
)
def test_strange_arguments_are_refused_in_one_line(
    refusal, tmp_path, monkeypatch, tetrahedron, argv, named
):
    monkeypatch.chdir(tmp_path)
    assert named in refusal(*argv)
    assert list(tmp_path.iterdir()) == [tetrahedron]


def test_the_meshes_of_a_benchmark_are_read_before_anything_is_measured(refusal, monkeypatch):
    monkeypatch.setattr(bench, "collect", lambda: pytest.fail("it measures"))
    assert "'missing.obj' does not exist" in refusal("bench", "missing.obj")


@pytest.mark.parametrize("name", ["model", "look"])
def test_a_nul_in_a_scene_file_is_refused(refusal, tmp_path, name):
    text = {"model": "a.xml", "look": "rubber"} | {name: "a\\u0000b"}
    scene = tmp_path / "scene.toml"
    scene.write_text(
        f'model = "{text["model"]}"\n[[ripple]]\ngeom = "g"\nlook = "{text["look"]}"\n'
    )
    assert "without a NUL" in refusal("render", str(scene), "-o", str(tmp_path / "x.mp4"))
