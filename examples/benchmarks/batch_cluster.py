"""Time for 10,000 scenes of 24 frames of 256x256: on two cores, and on 1,000 workers.

    python examples/benchmarks/batch_cluster.py DIR [--workers 1000] [--seed 0]

DIR is the folder of a batch that was made by the plan `examples/benchmarks/batch_movi.toml` or one
like it; the index tells what each scene took. These times are drawn again for the whole set, and a
cluster is simulated on which each worker takes the next scene as soon as it is free, after a start
of its own and a first scene that compiles the kernels. What the scheduler and this program do for a
scene, one scene after another, is measured with a Dask cluster of two processes whose scenes take
no time. `--cpu` takes processor times in place of the clock's, for a machine that was busy with
other things.
"""

import argparse
import heapq
import time
from pathlib import Path
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

from ripple_sim import load_batch
from ripple_sim.batch import DaskExecutor, Outcome

SCENES = 10_000
FRAMES = 24
START = 20.0  # of a worker: Python, its imports, the driver [s]
# of the first scene on a machine, which the others wait for: the kernels are compiled [s]
FIRST = 60.0


def handed_out(count: int = 2000) -> float:
    """Time of the scheduler and the program for a scene [s]: scenes that take no time."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        executor = DaskExecutor(cluster.scheduler_address)
        row = {"values": {f"key {k}": 0.5 for k in range(20)}}
        list(executor.map(Outcome, range(10), ["made"] * 10))
        start = time.perf_counter()
        futures = [executor.submit(Outcome, number, "made", {}, row) for number in range(count)]
        for future in futures:
            future.result()
        taken = time.perf_counter() - start
        executor.shutdown()
    return taken / count


def makespan(seconds: NDArray[np.float64], workers: int, books: float) -> float:
    """Time until all scenes are done if each free worker takes the next scene [s]."""
    ready = [START + FIRST] * workers
    heapq.heapify(ready)
    scheduler = ended = 0.0
    for each in seconds:
        scheduler = max(scheduler, heapq.heappop(ready)) + books
        done = scheduler + each
        ended = max(ended, done)
        heapq.heappush(ready, done)
    return ended


def main() -> None:
    parser = argparse.ArgumentParser(description="Extrapolates a batch.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--cpu", action="store_true", help="take processor times")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    scenes = [
        row for row in load_batch(options.folder).table().to_pylist() if row["status"] == "finished"
    ]
    measured = np.array([row["cpu_seconds" if options.cpu else "seconds"] for row in scenes])
    frames = scenes[0]["frames"]
    size = fmean(row["bytes"] for row in scenes)
    # without the first ones, which compile kernels
    measured = measured[measured < 5 * np.median(measured)]
    rng = np.random.default_rng(options.seed)
    seconds = rng.choice(measured, SCENES) * FRAMES / frames
    work = seconds.sum()
    books = handed_out()
    print(
        f"measured: {len(measured)} scenes of {frames} frames, median {np.median(measured):.2f} s "
        f"a scene and worker"
    )
    print(f"a scene takes the scheduler and the program {1000 * books:.2f} ms")
    print(f"{SCENES} scenes of {FRAMES} frames, {size * SCENES / 1e9:.1f} GB:")
    for workers in (1, 2, options.workers):
        total = makespan(seconds, workers, books)
        print(
            f"  {workers} workers: {total / 3600:.2f} h, efficiency "
            f"{100 * work / workers / total:.0f} %"
        )


if __name__ == "__main__":
    main()
