"""The processor's cores that this process may use."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

from .cgroup import cgroup_folders, text_of


def available_cores() -> list[int]:
    """Numbers of the cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def core_count(root: Path = Path("/")) -> int:
    """How many cores this process may keep busy: its cores, within the limits of its cgroups."""
    quotas = [math.ceil(quota) for quota in _quotas(root)]
    return max(1, min([len(available_cores()), *quotas]))


def _quotas(root: Path) -> Iterator[float]:
    """Cores whose whole time the limits of the cgroups allow, as far as there are limits."""
    for folder, is_first_version in cgroup_folders("cpu", root):
        if is_first_version:
            quota = text_of(folder / "cpu.cfs_quota_us").strip()  # "-1" without a limit
            period = text_of(folder / "cpu.cfs_period_us").strip()
        else:
            quota, _, period = text_of(folder / "cpu.max").strip().partition(" ")  # or "max ..."
        if quota.isdigit() and period.isdigit():
            yield int(quota) / int(period)
