"""A batch on a Kubernetes cluster, by dask-kubernetes.

    pip install 'ripple-sim[batch,dask]' dask-kubernetes
    python examples/batch_kubernetes.py PLAN.toml /data/DIR IMAGE VOLUME_CLAIM [--workers 100]

The cluster has the Dask operator. IMAGE holds ripple-sim with these extras; VOLUME_CLAIM names a
volume claim that all pods can write to and that is mounted at /data, where PLAN.toml and DIR lie,
also for this program.
"""

import argparse
import sys
from pathlib import Path

from ripple_sim import RunOptions, read_plan, run_batch


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes a batch on a Kubernetes cluster.")
    parser.add_argument("plan", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("image")
    parser.add_argument("claim")
    parser.add_argument("--workers", type=int, default=100)
    options = parser.parse_args()
    try:
        from dask_kubernetes.operator import KubeCluster, make_cluster_spec
    except ImportError as error:
        sys.exit(f"{error}; this example needs: pip install dask-kubernetes")
    spec = make_cluster_spec(
        name="ripple-sim",
        image=options.image,
        n_workers=options.workers,
        worker_command=["dask", "worker", "--nthreads", "1"],
        env={"LP_NUM_THREADS": "0", "NUMBA_NUM_THREADS": "1", "MUJOCO_GL": "disable"},
        resources={
            "requests": {"cpu": "1", "memory": "2Gi"},
            "limits": {"cpu": "1", "memory": "2Gi"},
        },
    )
    pod = spec["spec"]["worker"]["spec"]
    pod["volumes"] = [{"name": "data", "persistentVolumeClaim": {"claimName": options.claim}}]
    pod["containers"][0]["volumeMounts"] = [{"name": "data", "mountPath": "/data"}]
    with KubeCluster(custom_cluster_spec=spec) as cluster:
        print(
            run_batch(
                read_plan(options.plan), options.folder, RunOptions(dask=cluster.scheduler_address)
            )
        )


if __name__ == "__main__":
    main()
