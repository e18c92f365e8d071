"""The program as a process: signals, full disks, closed streams, no home."""

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType
from typing import BinaryIO
from weakref import WeakSet

import pytest
from programs import PROGRAMS, ended

from ripple_sim.cli import main as cli, signals
from ripple_sim.encode import open_writer
from ripple_sim.solver import load_atlas
from ripple_sim.solver.texels import atlas_file

BOTH = [signal.SIGINT, signal.SIGTERM]
ALL = [*BOTH, signal.SIGHUP]


@pytest.fixture(autouse=True)
def _no_timer() -> Iterator[None]:
    handler = signal.getsignal(signal.SIGALRM)
    hook = sys.unraisablehook
    # a shell in the background starts us with Ctrl-C ignored, and nohup with SIGHUP, which children
    # would inherit
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    yield
    sys.unraisablehook = hook
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, handler)


def ending_of(program: str, **variables: str) -> tuple[int, str, str]:
    """Exit status and both outputs of one of the tests' programs."""
    result = ended(PROGRAMS / program, env={**os.environ, **variables}, timeout=300)
    return result.returncode, result.stdout, result.stderr


def test_ctrl_c_and_termination_are_exceptions() -> None:
    signals.end_in_good_order()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    signals.end_in_good_order()
    with pytest.raises(SystemExit) as ending:
        signal.raise_signal(signal.SIGTERM)
    assert ending.value.code == signals.TERMINATED == 128 + signal.SIGTERM
    signals.end_in_good_order()
    with pytest.raises(SystemExit) as ending:
        signal.raise_signal(signal.SIGHUP)
    assert (ending.value.code, signals.word_of(129)) == (129, "hung up")
    assert signals.INTERRUPTED == 128 + signal.SIGINT


@pytest.mark.parametrize("number", BOTH)
@pytest.mark.parametrize("take", [signals.end_in_good_order, signals.end_at_once])
def test_a_signal_that_the_parent_ignores_stays_ignored(number: int, take: object) -> None:
    signal.signal(number, signal.SIG_IGN)
    take()
    assert signal.getsignal(number) is signal.SIG_IGN
    signal.raise_signal(number)  # nothing happens


def test_a_signal_during_an_import_is_raised_after_the_import() -> None:
    """An export that was interrupted while it imported its writer left a hidden folder behind."""
    number = str(int(signal.SIGTERM))
    status, output, _ = ending_of("clean_up_after_import.py", SIGNAL_ON_IMPORT=number)
    assert status == 128 + signal.SIGTERM
    assert output == "imported\ncleaned up\n"


def test_signals_end_the_program_in_good_order_during_its_first_imports() -> None:
    status, output, errors = ending_of("hang_up_at_start.py")
    assert status == 128 + signal.SIGHUP
    assert (output, errors) == ("", "ripple-sim: hung up\n")


def test_signals_during_shutdown_do_not_change_the_exit_status() -> None:
    assert ending_of("signals_at_shutdown.py") == (0, "done\n", "")


def meet_signal(number: int, happened: list[str]) -> None:
    os.kill(os.getpid(), number)
    time.sleep(0.1)
    happened.append("call ended")


def happenings_within(module: str, number: int, function: str = "call") -> list[str]:
    """Send a signal during a function of a module; return what happened before the exception."""
    code = meet_signal.__code__.replace(co_name=function, co_qualname=function)
    call = FunctionType(code, {"__name__": module, "os": os, "time": time})
    happened: list[str] = []
    signals.end_in_good_order()
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        call(number, happened)
        for _ in range(500):
            time.sleep(0.01)
        happened.append("no exception")
    return happened


@pytest.mark.parametrize("number", ALL)
def test_a_signal_is_raised_only_after_calls_of_fragile_libraries_have_ended(number: int) -> None:
    import moderngl
    from llvmlite.binding import ffi
    from pyvista.plotting import render_window_interactor
    from zarr.core import sync

    # VTK calls back, kernels are compiled or loaded, threads would write on, Python swallows what a
    # weak set's raise
    names = [each.__name__ for each in (moderngl, ffi, render_window_interactor, sync)]
    for name in (*names, WeakSet.__module__):
        assert happenings_within(name, number) == ["call ended"]
    assert happenings_within(open_writer.__module__, number, open_writer.__qualname__) == [
        "call ended"
    ]
    assert happenings_within("elsewhere", number) == []


def test_without_a_timer_of_the_system_a_thread_raises_the_signal_again(monkeypatch) -> None:
    """As on Windows."""
    monkeypatch.setattr(signals, "_HAS_TIMER", False)
    assert happenings_within("moderngl", signal.SIGINT) == ["call ended"]
    assert happenings_within("elsewhere", signal.SIGINT) == []


def test_a_signal_that_a_finalizer_swallows_is_raised_again() -> None:
    class Dying:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGTERM)

    signals.end_in_good_order()
    with pytest.raises(SystemExit):
        Dying()
        for _ in range(500):
            time.sleep(0.01)


def test_a_second_signal_ends_the_process_while_the_first_is_cleaned_up() -> None:
    status, _, err = ending_of("signal_during_cleanup.py")
    # a job in the background has Ctrl-C ignored, and then cleans up
    assert (status, err) in ((130, "ripple-sim: interrupted\n"), (143, ""))


def run(
    folder: Path, words: str, redirections: str = "", **environment: str | None
) -> subprocess.CompletedProcess:
    """The program in a shell."""
    command = f"{sys.executable} -m ripple_sim {words} {redirections}"
    env = {
        name: value for name, value in {**os.environ, **environment}.items() if value is not None
    }
    words = ["sh", "-c", command]
    return subprocess.run(
        words, cwd=folder, env=env, capture_output=True, text=True, timeout=600, check=False
    )


@pytest.mark.parametrize(
    ("words", "redirections", "status"),
    [
        ("fly", ">&- 2>&-", 2),
        ("fly", "2>/dev/full", 2),
        ("completion bash", ">&-", 0),
        ("--help", "| head -c 0", 0),
    ],
)
def test_closed_and_full_streams_give_the_right_exit_status_without_a_message(
    tmp_path: Path, words: str, redirections: str, status: int
) -> None:
    result = run(tmp_path, words, redirections)
    assert (result.returncode, result.stdout, result.stderr) == (status, "", "")


def test_without_streams_home_and_cache_an_atlas_is_whole(
    tmp_path: Path, tetrahedron: Path
) -> None:
    words = f"atlas {tetrahedron} --resolution 4 -o mesh.npz"
    cache = "/dev/null"
    result = run(tmp_path, words, "<&- >&- 2>&-", HOME=None, XDG_CACHE_HOME=cache)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert load_atlas(tmp_path / "mesh.npz").resolution == 4
    assert sorted(each.name for each in tmp_path.iterdir()) == ["mesh.npz", tetrahedron.name]


def test_the_exit_status_on_a_full_disk_is_1(tmp_path, monkeypatch, capsys, tetrahedron) -> None:
    def full(file: BinaryIO, *_: object) -> None:
        file.write(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(atlas_file, "write_arrays", full)
    assert (
        cli.main(["atlas", str(tetrahedron), "--resolution", "4", "-o", str(tmp_path / "a.npz")])
        == 1
    )
    assert capsys.readouterr().err.endswith("a.npz' cannot be written: No space left on device\n")
    assert list(tmp_path.iterdir()) == [tetrahedron]
