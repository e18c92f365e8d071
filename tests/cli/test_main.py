"""The program's manners: quick help, one line for a mistake, exit statuses, nothing left behind."""

import os
import re
import signal
import subprocess
import sys
import warnings

import pytest

from ripple_sim.cli import main as cli
from ripple_sim.cli import parser
from ripple_sim.errors import EncodingError, RippleWarning, SceneError
from ripple_sim.solver.errors import GLError


@pytest.fixture(autouse=True)
def _left_as_found(tmp_path_factory, monkeypatch):
    """Keep the program's signal handlers and its cache to these tests."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture
def tetrahedron(tmp_path):
    path = tmp_path / "tetrahedron.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return path


def complaint(capsys, *argv: str) -> str:
    """Run what must be refused; return its one line on stderr."""
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("ripple-sim: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    return err


@pytest.mark.parametrize("command", [[], ["render"], ["drop"], ["atlas"], ["info"]])
def test_help_is_given(capsys, command):
    assert cli.main([*command, "--help"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(" ".join(["usage: ripple-sim", *command]))
    assert err == ""


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "render, drop, export, batch, atlas, info"),
        (["fly"], "fly"),
        (["render", "duck"], "--output"),
        (["render", "-o", "x.mp4"], "SCENE"),
        (["render", "duck", "-o", "x.mp4", "--colour", "red"], "--colour"),
        (["render", "duck", "-o", "x.mp4", "--size", "big"], "--size.*'big'.*1280x720"),
        (["render", "duck", "-o", "x.mp4", "--fps", "-5"], "--fps.*'-5'"),
        (["render", "duck", "-o", "x.mp4", "--duration", "nan"], "--duration.*'nan'.*positive"),
        (["render", "duck", "-o", "x.mp4", "--resolution", "1.5"], "--resolution.*'1.5'"),
        (["render", "duck", "-o", "x.mp4", "--slow-motion", "0"], "--slow-motion.*'0'.*positive"),
        (["render", "duck", "-o", "x.mp4", "--supersample", "9"], "--supersample.*'9'.*1, 2, 3 or 4"),
        (["render", "duck", "-o", "x.mp4", "--shutter", "361"], "--shutter.*'361'.*0 to 360"),
        (["render", "duck", "-o", "x.mp4", "--aperture", "f/2"], "--aperture.*'f/2'.*metres"),
        (["render", "duck", "-o", "x.mp4", "--exposures", "0"], "--exposures.*'0'"),
        (["render", "duck", "-o", "x.mp4", "--device", "gpu"], "--device.*'gpu'"),
        (["render", "duck", "-o", "x.mp4", "--backend", "vulkan"], "vulkan.*--backend.*auto"),
        (["drop", "mesh.obj", "-o", "x.mp4", "--bodies", "0"], "--bodies.*'0'"),
        (["drop", "mesh.obj", "-o", "x.mp4", "--seed", "luck"], "--seed.*'luck'"),
        (["info", "--yaml"], "--yaml"),
    ],
)
def test_a_usage_error_names_the_argument_and_the_help(capsys, argv, named):
    line = complaint(capsys, *argv)
    assert re.search(named, line)
    assert line.rstrip().endswith(f"; see ripple-sim {argv[0]} --help" if len(argv) > 1 else "; see ripple-sim --help")
    assert line.isascii()


def test_a_usage_error_reads_the_same_in_every_locale():
    result = subprocess.run(
        [sys.executable, "-m", "ripple_sim", "render", "duck", "-o", "x.mp4", "--backend", "vulkan"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "FORCE_COLOR": "1"},
        check=False,
    )
    assert result.returncode == 2
    assert result.stderr == (
        "ripple-sim: invalid choice 'vulkan' for argument '--backend'. Expected one of ('auto', 'gl', 'cpu'); "
        "see ripple-sim render --help\n"
    )


@pytest.mark.parametrize("command", ["render", "drop"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["-o", "clip.avi"], r"clip\.avi.*valid is \.mp4"),
        (["-o", ".mp4"], r"\.mp4', which is not a file name"),
        (["-o", "x."], r"x\. ends in \.; valid is"),
        (["-o", "clip.mp4", "--size", "641x360"], "641x360.*even"),
        (["-o", "clip.gif", "--fps", "60"], "60.*1 to 50"),
    ],
)
def test_a_bad_output_is_refused_before_the_scene_is_read(tmp_path, monkeypatch, capsys, command, options, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken").touch()
    assert re.search(said, complaint(capsys, command, "broken", *options))
    assert list(tmp_path.iterdir()) == [tmp_path / "broken"]


def test_a_place_that_cannot_be_written_is_a_failure_in_one_line(capsys):
    assert cli.main(["render", "duck", "-o", "/proc/clip.mp4"]) == 1
    assert re.fullmatch(r"ripple-sim: cannot write /proc/clip\.mp4: .*\n", capsys.readouterr().err)


def test_a_device_that_is_not_there_is_a_failure_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("ripple_sim.solver.gl.context._selected", None)  # put back after the test
    assert cli.main(["render", "sphere", "-o", str(tmp_path / "clip.mp4"), "--device", "77"]) == 1
    assert re.fullmatch(r"ripple-sim: no OpenGL .* on EGL device 77 .*\n", capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []


def test_a_camera_that_is_not_there_is_named(tmp_path, capsys):
    assert "no camera 'front'; its cameras are hero" in complaint(
        capsys, "render", "sphere", "-o", str(tmp_path / "clip.mp4"), "--camera", "front"
    )


@pytest.mark.parametrize(
    "argv",
    [
        ["render", "missing.toml", "-o", "clip.mp4"],
        ["render", "no such scene", "-o", "clip.mp4"],
        ["drop", "missing.obj", "-o", "clip.mp4"],
        ["batch", "missing.toml", "-o", "batch"],
        ["atlas", "missing.obj", "-o", "atlas.npz"],
    ],
)
def test_a_missing_input_is_named_and_nothing_written(tmp_path, monkeypatch, capsys, argv):
    monkeypatch.chdir(tmp_path)
    said = complaint(capsys, *argv)
    assert argv[1] in said
    assert "Errno" not in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "argv",
    [
        ["view", "missing"],
        ["view", "missing.toml", "--web"],
        ["export", "missing", "-o", "run.usdc"],
        ["render", "missing", "-o", "clip.mp4", "--renderer", "cycles"],
        ["drop", "missing.obj", "-o", "frames", "--frame-format", "exr"],
        ["batch", "missing.toml", "-o", "batch"],
        ["atlas", "missing.obj", "--inside", "scan.nii"],
    ],
    ids=lambda argv: argv[0],
)
def test_a_missing_input_is_told_before_what_the_machine_lacks(tmp_path, monkeypatch, capsys, argv):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for package in ("pyarrow", "OpenEXR", "nibabel"):
        monkeypatch.setitem(sys.modules, package, None)
    assert argv[1] in complaint(capsys, *argv)


def test_atlas_refuses_an_unwritable_file_and_an_unknown_method(capsys, tetrahedron):
    assert "/proc/atlas.npz" in complaint(
        capsys, "atlas", str(tetrahedron), "--resolution", "8", "-o", "/proc/atlas.npz"
    )
    assert "'mercator'" in complaint(capsys, "atlas", str(tetrahedron), "--method", "mercator")


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (SceneError("geom 'x' is missing;\nadd it"), 2),
        (GLError("no OpenGL"), 1),
        (EncodingError("disk full"), 1),
        (KeyboardInterrupt(), 130),
    ],
)
def test_the_exit_status_tells_what_kind_of_error_it_was(monkeypatch, capsys, error, status):
    def run(self):
        raise error

    monkeypatch.setattr(parser.InfoCommand, "run", run)
    assert cli.main(["info"]) == status
    line = capsys.readouterr().err
    assert line.startswith("ripple-sim: ")
    assert line.count("\n") == 1


def test_an_unexpected_error_is_not_hidden(monkeypatch):
    def run(self):
        raise ZeroDivisionError

    monkeypatch.setattr(parser.InfoCommand, "run", run)
    with pytest.raises(ZeroDivisionError):
        cli.main(["info"])


@pytest.mark.parametrize(
    ("number", "status", "word", "where"),
    [
        (signal.SIGINT, 130, "interrupted", "cli._parse = meet_signal"),
        (signal.SIGTERM, 143, "terminated", "parser.InfoCommand.run = meet_signal"),
    ],
)
def test_a_signal_while_modules_are_imported_ends_the_program_with_one_line(tmp_path, number, status, word, where):
    (tmp_path / "slow.py").write_text(f"import os\nos.kill(os.getpid(), {int(number)})\n")
    code = (
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # which a job in the background has ignored
        "from ripple_sim.cli import parser\n"
        "from ripple_sim.cli import main as cli\n"
        "def meet_signal(argument):\n"
        "    import slow\n"
        "    for _ in range(10**9): pass\n"
        f"{where}\n"
        "sys.exit(cli.main(['info']))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, timeout=300, check=False
    )
    assert (result.returncode, result.stderr) == (status, f"ripple-sim: {word}\n")


def test_an_interrupted_command_says_what_is_left(monkeypatch, capsys):
    def run(self):
        ending = KeyboardInterrupt()
        ending.add_note("48 frames are kept")
        raise ending

    monkeypatch.setattr(parser.InfoCommand, "run", run)
    assert cli.main(["info"]) == 130
    assert capsys.readouterr().err == "ripple-sim: interrupted; 48 frames are kept\n"


def test_a_warning_is_one_line_and_the_handler_is_given_back(monkeypatch, capsys):
    def run(self):
        warnings.warn("the hull is\noff the surface", RippleWarning, stacklevel=1)

    before = warnings.showwarning
    monkeypatch.setattr(parser.InfoCommand, "run", run)
    assert cli.main(["info"]) == 0
    assert capsys.readouterr().err == "ripple-sim: warning: the hull is off the surface\n"
    assert warnings.showwarning is before


def test_help_loads_nothing_heavy():
    code = (
        "import sys, ripple_sim\n"
        "from ripple_sim.cli.main import main\n"
        "main(['--help'])\n"
        "heavy = {'vtkmodules', 'pyvista', 'trame', 'numba', 'mujoco', 'moderngl', 'av', 'scipy'}\n"
        "print(sorted(heavy & set(sys.modules)))\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "[]"
