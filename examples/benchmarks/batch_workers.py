"""How much more do two workers make than one, and what does a scene cost beside its frames?

    python examples/benchmarks/batch_workers.py [SCENE] [--scenes 16] [--frames 24]

Makes a batch of small scenes (256x256, N = 64) by one worker and by two, and scenes of twice as many frames by one
worker, each in a folder of its own. Rates are taken from when scenes were finished, from the first of each worker on,
so that the start of the program does not count. What a scene costs beside its frames is what is left of its time if
frames take what the additional ones took.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

PLAN = """
scenes = ["{scene}"]
count = {count}
[vary]
camera.azimuth = {{uniform = [0, 360]}}
"ripple.material.speed" = {{uniform = [0.8, 1.25], apply = "multiply"}}
[store]
size = [256, 256]
fps = 24
duration = {duration}
resolution = 64
"""


def make(folder: Path, scene: str, count: int, frames: int, workers: int) -> Path:
    """Make a batch by the program itself."""
    folder.mkdir()
    plan = folder / "plan.toml"
    plan.write_text(PLAN.format(scene=scene, count=count, duration=frames / 24))
    command = [sys.executable, "-m", "ripple_sim", "batch", plan, "-o", folder / "out", "--workers", str(workers)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return folder / "out"


def seconds_each(batch: Path, workers: int) -> float:
    """Seconds between finished scenes, once every worker has made one."""
    ends = sorted(path.stat().st_mtime for path in batch.glob("scenes/*/times.json"))
    return (ends[-1] - ends[workers - 1]) / (len(ends) - workers)


def main() -> None:
    parser = argparse.ArgumentParser(description="Times batches by one worker and by two.")
    parser.add_argument("scene", nargs="?", default="duck")
    parser.add_argument("--scenes", type=int, default=16)
    parser.add_argument("--frames", type=int, default=24)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder / "warm", options.scene, 1, 2, 1)
        one = make(folder / "one", options.scene, options.scenes, options.frames, 1)
        two = make(folder / "two", options.scene, options.scenes, options.frames, 2)
        long = make(folder / "long", options.scene, options.scenes // 2, 2 * options.frames, 1)
        single, double, longer = seconds_each(one, 1), seconds_each(two, 2), seconds_each(long, 1)
        facts = json.loads((one / "scenes" / "000000" / "scene.json").read_text())
    frame = (longer - single) / options.frames
    beside = single - options.frames * frame
    print(f"{options.scene}, {facts['frames']} frames of 256x256, N = 64")
    print(f"1 worker:  {3600 / single:6.0f} scenes an hour, {single:.2f} s each")
    print(f"2 workers: {3600 / double:6.0f} scenes an hour, {double:.2f} s each: {single / double:.2f} times as many")
    print(f"1 worker: a frame {1000 * frame:.1f} ms; beside its frames a scene takes {1000 * beside:.0f} ms,")
    print(f"          {100 * beside / (options.frames * frame):.0f} % of them")


if __name__ == "__main__":
    main()
