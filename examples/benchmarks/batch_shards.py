"""Do 1, 2 and 4 shards, and Dask, make the same bytes?

    python examples/benchmarks/batch_shards.py [SCENE] [--scenes 16]

The same plan is made whole by one worker, in 2 and in 4 shards that run at the same time in one
folder, and by a Dask cluster of two processes; videos, passes, heights, impulses and tar files are
compared byte for byte.
"""

import argparse
import hashlib
import sys
import tempfile
from pathlib import Path

from sample_batch import SMALL, start, write_plan

VERDICT = {True: "the same bytes", False: "DIFFERENT"}


def digests(output: Path) -> dict[str, str]:
    """Of all files of the scenes, but for those that tell who made them."""
    files = [
        path for name in ("scenes", "tars") for path in (output / name).rglob("*") if path.is_file()
    ]
    return {
        str(path.relative_to(output)): hashlib.blake2b(path.read_bytes()).hexdigest()
        for path in files
        if not path.name.endswith("times.json")
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Compares shards and Dask with one worker.")
    parser.add_argument("scene", nargs="?", default="sphere")
    parser.add_argument("--scenes", type=int, default=16)
    options = parser.parse_args()
    from distributed import LocalCluster

    different = False
    for form in ("folders", "webdataset"):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            store = f'{SMALL}format = "{form}"\nscenes_per_tar = 3\n'
            plan = write_plan(folder / "plan.toml", [options.scene], options.scenes, store)
            start(plan, folder / "whole", "--workers", "1").wait()
            expected = digests(folder / "whole")
            print(f"{form}: {len(expected)} files by one worker", flush=True)
            for shards in (2, 4) if form == "folders" else (2,):
                output = folder / f"shards{shards}"
                parts = [
                    start(plan, output, "--workers", "1", "--shard", f"{part + 1}/{shards}")
                    for part in range(shards)
                ]
                status = [part.wait() for part in parts]
                same = digests(output) == expected
                different |= not same
                print(f"  {shards} shards: exit status {status}, {VERDICT[same]}", flush=True)
            with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
                status = [start(plan, folder / "dask", "--dask", cluster.scheduler_address).wait()]
            same = digests(folder / "dask") == expected
            different |= not same
            print(f"  Dask, 2 processes: exit status {status}, {VERDICT[same]}", flush=True)
    sys.exit(different)


if __name__ == "__main__":
    main()
