"""Does a worker's memory stay flat over many scenes?

    python examples/benchmarks/batch_memory.py [SCENE ...] [--scenes 200]

Makes scenes one after another in this process, as a worker does, and prints the resident memory
(RSS) now and then; of several scenes they take turns.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np
from sample_batch import write_plan

from ripple_sim import read_plan
from ripple_sim.batch import BatchFolder, keep_plan, make_scene, stored


def resident() -> float:
    """Memory of this process [MB]."""
    line = next(
        line
        for line in Path("/proc/self/status").read_text().splitlines()
        if line.startswith("VmRSS")
    )
    return int(line.split()[1]) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description="Follows the memory of a worker.")
    parser.add_argument("names", nargs="*", default=["sphere", "duck"], metavar="SCENE")
    parser.add_argument("--scenes", type=int, default=200)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        path = write_plan(Path(name) / "plan.toml", options.names, options.scenes)
        batch = BatchFolder(Path(name) / "out")
        keep_plan(batch, stored(read_plan(path)))
        sizes = []
        for number in range(options.scenes):
            outcome = make_scene(str(batch.path), number)
            assert outcome.state == "made", outcome.error
            sizes.append(resident())
            if (number + 1) % (options.scenes // 10) == 0:
                print(f"{number + 1} scenes: {sizes[-1]:.0f} MB", flush=True)
    half = np.array(sizes[len(sizes) // 2 :])
    slope = np.polyfit(np.arange(len(half)), half, 1)[0]
    print(f"second half: {half.min():.0f} to {half.max():.0f} MB, {1000 * slope:+.0f} kB a scene")


if __name__ == "__main__":
    main()
