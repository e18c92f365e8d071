"""Signals become exceptions where there is something to clean up, and end the process at once where there is not."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from ripple_sim.cli import signals

BOTH = [signal.SIGINT, signal.SIGTERM]


@pytest.fixture(autouse=True)
def _left_as_found() -> Iterator[None]:
    handlers = {number: signal.getsignal(number) for number in BOTH}
    # a shell in the background starts us with Ctrl-C ignored, which children would inherit
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


def test_ctrl_c_and_termination_are_exceptions() -> None:
    signals.end_in_good_order()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    with pytest.raises(SystemExit) as ending:
        signal.raise_signal(signal.SIGTERM)
    assert ending.value.code == signals.TERMINATED == 128 + signal.SIGTERM
    assert signals.INTERRUPTED == 128 + signal.SIGINT


@pytest.mark.parametrize("number", BOTH)
@pytest.mark.parametrize("take", [signals.end_in_good_order, signals.end_at_once])
def test_a_signal_that_the_parent_ignores_stays_ignored(number: int, take: object) -> None:
    signal.signal(number, signal.SIG_IGN)
    take()
    assert signal.getsignal(number) is signal.SIG_IGN
    signal.raise_signal(number)  # nothing happens


@pytest.mark.parametrize(("number", "line"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
@pytest.mark.parametrize("importing", [False, True])
def test_before_a_command_and_during_imports_the_process_ends_with_one_line(
    tmp_path: os.PathLike, number: int, line: str, importing: bool
) -> None:
    send = f"import signal\nsignal.raise_signal({int(number)})\n"
    (tmp_path / "slow.py").write_text(send)
    take, then = ("end_in_good_order", "import slow") if importing else ("end_at_once", send)
    program = (
        f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\nfrom ripple_sim.cli import signals\n"
        f"signals.{take}()\ntry:\n    exec({then!r})\nexcept BaseException as error:\n    print(repr(error))\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert result.returncode == 128 + number
    assert (result.stdout, result.stderr) == ("", f"ripple-sim: {line}\n")
