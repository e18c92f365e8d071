"""A batch that is killed again and again gives the same result as an unbroken batch.

    python examples/benchmarks/batch_kills.py [SCENE] [--kills 20] [--scenes 60] [--workers 2]

`ripple-sim batch` is started, and killed (SIGKILL) at random moments, itself and one of its workers
in turn: when some more scenes have been finished, or soon after the last kill, while processes
start. It is started again whenever it has died. Then it is left to finish, and the hashes of all
files are compared with those of a batch that was left alone.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sample_batch import SMALL, start, write_plan

from ripple_sim import load_batch
from ripple_sim.batch import BatchFolder

STORE = f'{SMALL}format = "webdataset"\nscenes_per_tar = 8\n'


def workers_of(parent: int) -> list[int]:
    """Processes that make scenes for a batch."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(path.read_text().rsplit(")", 1)[1].split()[1]) == parent:
                found += (
                    [int(path.parent.name)]
                    if b"spawn_main" in (path.parent / "cmdline").read_bytes()
                    else []
                )
        except (OSError, ValueError):
            continue
    return found


def finished(output: Path) -> set[int]:
    """Numbers of the scenes that are there."""
    return BatchFolder(output).finished() if output.is_dir() else set()


def hashes(output: Path) -> dict[int, tuple[str, dict[str, str]]]:
    """The hash of each scene, and those of its files."""
    facts = [scene.facts() for scene in load_batch(output)]
    return {each["number"]: (each["hash"], each["files"]) for each in facts}


def kill(process: subprocess.Popen, parent: bool) -> str:
    """Kill a batch, or one of its workers as soon as it has any."""
    while not parent and process.poll() is None:
        if workers := workers_of(process.pid):
            os.kill(random.choice(workers), signal.SIGKILL)
            return "worker"
        time.sleep(0.05)
    process.kill()
    process.wait()
    return "parent"


def main() -> None:
    parser = argparse.ArgumentParser(description="Kills a batch, starts it again, and compares.")
    parser.add_argument("scene", nargs="?", default="sphere")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    random.seed(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = write_plan(folder / "plan.toml", [options.scene], options.scenes, STORE)
        whole = folder / "whole"
        broken = folder / "broken"
        workers = ("--workers", str(options.workers))
        start(plan, whole, *workers).wait()
        process = start(plan, broken, *workers)
        killed = []
        target = 0
        while len(killed) < options.kills and process.poll() is None:
            target += random.randrange(2 * options.scenes // options.kills)
            while process.poll() is None and len(finished(broken)) < min(
                target, options.scenes - 1
            ):
                time.sleep(0.05)
            time.sleep(random.uniform(0, 3))
            killed.append(kill(process, parent=len(killed) % 2 == 0))
            if killed[-1] == "parent":
                process = start(plan, broken, *workers)
        ended = process.wait()
        logs = sorted(path.name for path in (broken / "failed").glob("*.log"))
        expected = hashes(whole)
        found = hashes(broken)
        bytes_equal = all(
            tar.read_bytes() == (broken / "tars" / tar.name).read_bytes()
            for tar in (whole / "tars").glob("*.tar")
        )
        work = sorted(path.name for path in (broken / "work").iterdir() if path.name.isdecimal())
    print(
        f"killed {len(killed)} times: {killed.count('parent')} times the parent, "
        f"{killed.count('worker')} a worker"
    )
    print(
        f"last exit status {ended}; scenes {len(found)} of {len(expected)}, logs left {logs}, "
        f"unfinished {work}"
    )
    print(f"hashes of all scenes and files {'equal' if expected == found else 'DIFFER'}")
    print(f"tar files {'equal byte for byte' if bytes_equal else 'DIFFER'}")
    sys.exit(expected != found or not bytes_equal)


if __name__ == "__main__":
    main()
