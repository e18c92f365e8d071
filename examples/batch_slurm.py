"""A batch on a Slurm cluster, by dask-jobqueue.

    pip install 'ripple-sim[batch,dask]' dask-jobqueue
    python examples/batch_slurm.py PLAN.toml DIR [--jobs 25] [--cores 40]

Run it on a node that may submit jobs. PLAN.toml and DIR lie on a file system that all nodes share.
A job that ends at its time limit gives way to the next one: scenes that were not finished are made
again.
"""

import argparse
import sys
from pathlib import Path

from ripple_sim import RunOptions, read_plan, run_batch


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes a batch on a Slurm cluster.")
    parser.add_argument("plan", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=25)
    parser.add_argument("--cores", type=int, default=40, help="of a node")
    options = parser.parse_args()
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError as error:
        sys.exit(f"{error}; this example needs: pip install dask-jobqueue")
    cluster = SLURMCluster(
        cores=options.cores,
        processes=options.cores,  # one thread each: a renderer belongs to one process
        memory=f"{2 * options.cores} GB",
        walltime="08:00:00",
        worker_extra_args=["--lifetime", "7h50m", "--lifetime-stagger", "5m"],
        job_script_prologue=["export LP_NUM_THREADS=0 NUMBA_NUM_THREADS=1 MUJOCO_GL=disable"],
    )
    cluster.adapt(maximum_jobs=options.jobs)
    print(
        run_batch(
            read_plan(options.plan), options.folder, RunOptions(dask=cluster.scheduler_address)
        )
    )


if __name__ == "__main__":
    main()
