"""The plan as it stands in the folder of a batch, and how another differs from it."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import msgspec

from ripple_sim.errors import BatchError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.solver.errors import shown
from ripple_sim.solver.files import atomic_write
from ripple_sim.video.provenance import scene_digest

from .folder import BatchFolder
from .plan import Plan

_PACKAGES = ("ripple-sim", "mujoco", "numpy", "numba", "moderngl", "av", "pillow")

# A larger batch begins like a smaller one; tar files tell themselves what is in them.
_MAY_CHANGE = ("plan.count",)


class StoredPlan(msgspec.Struct, frozen=True):
    """A plan with all that decides its scenes: fingerprints of its files, and versions of the software."""

    plan: Plan
    files: dict[str, str]
    versions: dict[str, str]


def stored(plan: Plan) -> StoredPlan:
    """The plan with the fingerprints of its files; reads all of them.

    Raises
    ------
    RippleError
        If one is invalid.
    """
    files = {source: _fingerprint(source) for source in dict.fromkeys(plan.sources)}
    return StoredPlan(plan, files, {package: version(package) for package in _PACKAGES})


def keep_plan(batch: BatchFolder, plan: StoredPlan) -> None:
    """Write the plan into the folder of its batch, or make sure that the one there is the same.

    Raises
    ------
    BatchError
        Naming what has changed.
    """
    if batch.plan.exists():
        before, now = _flat(load_stored(batch.plan)), _flat(plan)
        changed = sorted(
            key for key in before.keys() | now.keys() if before.get(key) != now.get(key) and key not in _MAY_CHANGE
        )
        if changed:
            key = changed[0]
            more = f", and {len(changed) - 1} more ({', '.join(changed[1:4])})" if len(changed) > 1 else ""
            raise BatchError(
                f"{batch.path} holds a batch by another plan: {key} was {shown(before.get(key))} and is "
                f"{shown(now.get(key))}{more}; take it back, or name another folder"
            )
    elif batch.path.is_dir() and any(batch.path.iterdir()):
        raise BatchError(f"{batch.path} holds other files and no batch; name a new folder")
    batch.make()
    with atomic_write(batch.plan) as path:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(plan), indent=1))


def load_stored(path: Path) -> StoredPlan:
    """Read the plan in the folder of a batch; raises `BatchError`."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=StoredPlan)
    except (OSError, msgspec.MsgspecError) as error:
        raise BatchError(f"{path} cannot be read: {error}; it is the plan of a batch and must stay as it is") from error


@functools.lru_cache(maxsize=4)
def _load_plan(path: Path, modified: int) -> Plan:
    return load_stored(path).plan


def load_plan(path: Path) -> Plan:
    """Read the plan that a worker makes scenes by."""
    return _load_plan(path, path.stat().st_mtime_ns)


def _fingerprint(source: str) -> str:
    if Path(source).suffix in ("", ".toml"):
        return scene_digest(load_scene(source))
    return hashlib.blake2b(Path(source).read_bytes(), digest_size=8).hexdigest()


def _flat(value: Any) -> dict[str, Any]:
    """Values of nested tables by keys with dots; files by their names, wherever the plan is."""
    content = msgspec.to_builtins(value)
    plan = content["plan"]
    plan["sources"] = [Path(source).name for source in plan["sources"]]
    content["files"] = {Path(source).name: digest for source, digest in content["files"].items()}
    found: dict[str, Any] = {}

    def walk(table: dict[str, Any], before: str) -> None:
        for key, inner in table.items():
            name = f"{before}.{key}" if before else key
            if isinstance(inner, dict) and before not in ("plan.vary", "plan.model"):
                walk(inner, name)
            else:
                found[name] = inner

    walk(content, "")
    return found
