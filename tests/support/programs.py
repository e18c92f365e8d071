"""Python programs in processes of their own."""

import os
import signal
import subprocess
import sys
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

PROGRAMS = Path(__file__).parents[1] / "programs"


def ended(*words: Any, **options: Any) -> subprocess.CompletedProcess[str]:
    """A Python process with these arguments, after its end; options of `subprocess.run`."""
    return subprocess.run(
        [sys.executable, *words],
        **{"capture_output": True, "text": True, "check": False, **options},
    )


def begin_command(home: Path, words: str, begun: Event) -> None:
    """Be the program with these words in a folder; workers are this very process.

    It may be killed once it has `begun`.

    What it says is in the folder's file `said`; its cache is there too.
    """
    from small_batch import Here

    from ripple_sim.batch import run
    from ripple_sim.cli.main import main
    from ripple_sim.cli.signals import end_at_once
    from ripple_sim.figures import atlas_painter

    signal.signal(signal.SIGINT, signal.default_int_handler)
    end_at_once()  # as the program does before it imports what is above
    os.chdir(home)
    os.environ["XDG_CACHE_HOME"] = str(home / "cache")
    os.dup2(os.open("said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    run.LocalExecutor = Here  # type: ignore[misc,assignment]
    atlas_painter.OVERSAMPLING = 1
    begun.set()
    sys.exit(main(words.split()))
