"""How much more do two workers make than one, and what does a scene cost beside its frames?

    python examples/benchmarks/batch_workers.py [SCENE] [--scenes 16] [--frames 24]

Makes a batch of small scenes (256x256, N = 64) by two workers with a core each, by one with both
cores, and by one that has one core alone; then scenes of twice as many frames by one worker. Rates
are taken from when scenes were finished, from the first of each worker on, so that the start of the
program does not count. What a scene costs beside its frames is what is left of its time if frames
take what the additional ones took.
"""

import argparse
import json
import os
import statistics
import tempfile
from pathlib import Path

from sample_batch import start, write_plan


def make(folder: Path, scene: str, count: int, frames: int, workers: int) -> Path:
    """Make a batch by the program itself."""
    folder.mkdir()
    store = f"size = [256, 256]\nduration = {frames / 24}\nresolution = 64\n"
    plan = write_plan(folder / "plan.toml", [scene], count, store)
    if start(plan, folder / "out", "--workers", str(workers)).wait():
        raise SystemExit(f"the batch in {folder} failed")
    return folder / "out"


def make_on_one_core(folder: Path, scene: str, count: int, frames: int) -> Path:
    """The same by a program that may use one core only."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        return make(folder, scene, count, frames, 1)
    finally:
        os.sched_setaffinity(0, cores)


def times(batch: Path) -> list[dict]:
    """What each scene took, and when it was finished, in that order."""
    found = [
        (path.stat().st_mtime, json.loads(path.read_text()))
        for path in batch.glob("scenes/*/times.json")
    ]
    return [{**taken, "end": end} for end, taken in sorted(found, key=lambda each: each[0])]


def seconds_each(batch: Path, workers: int) -> float:
    """Seconds between finished scenes, once every worker has made one."""
    ends = [scene["end"] for scene in times(batch)]
    return (ends[-1] - ends[workers - 1]) / (len(ends) - workers)


def main() -> None:
    parser = argparse.ArgumentParser(description="Times batches by one worker and by two.")
    parser.add_argument("scene", nargs="?", default="duck")
    parser.add_argument("--scenes", type=int, default=16)
    parser.add_argument("--frames", type=int, default=24)
    options = parser.parse_args()
    asked = options.scene, options.scenes, options.frames
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder / "warm", options.scene, 1, 2, 1)
        two = make(folder / "two", *asked, 2)
        both = make(folder / "both", *asked, 1)
        one = make_on_one_core(folder / "one", *asked)
        long = make(folder / "long", options.scene, options.scenes // 2, 2 * options.frames, 1)
        double = seconds_each(two, 2)
        single = seconds_each(both, 1)
        alone = seconds_each(one, 1)
        frame = (seconds_each(long, 1) - single) / options.frames
        busy = [
            statistics.mean(scene["cpu_seconds"] for scene in times(batch)[1:])
            for batch in (both, one)
        ]
        facts = json.loads((both / "scenes" / "000000" / "scene.json").read_text())
    print(f"{options.scene}, {facts['frames']} frames of 256x256, N = 64")
    for who, seconds in (
        ("2 workers, a core each", double),
        ("1 worker, both", single),
        ("1 worker, one core", alone),
    ):
        rate = f"{3600 / seconds:.0f} scenes an hour, {seconds:.2f} s each"
        print(f"{who}: {rate}; 2 workers make {seconds / double:.2f} times as many")
    print(f"processor time of a scene: {busy[0]:.2f} s on both cores, {busy[1]:.2f} s on one")
    beside = single - options.frames * frame
    print(
        f"1 worker, both: a frame {1000 * frame:.1f} ms; beside its frames a scene takes "
        f"{1000 * beside:.0f} ms,"
    )
    print(f"                {100 * beside / (options.frames * frame):.0f} % of them")


if __name__ == "__main__":
    main()
