"""How far a batch is, from its folder alone."""

from __future__ import annotations

from pathlib import Path

from .folder import BatchFolder
from .stored_plan import load_stored

_LISTED = 5  # failures


def status_text(path: Path) -> str:
    """What is finished, what failed and why, and what is still to be made.

    Raises
    ------
    BatchError
        If there is no batch in the folder.
    """
    batch = BatchFolder(path)
    batch.check()
    count = load_stored(batch.plan).plan.count
    finished = {number for number in batch.finished() if number < count}
    failures = {number: each for number, each in batch.failures().items() if number not in finished}
    aside = [number for number, each in failures.items() if each.aside]
    lines = [
        f"{path}: {len(finished)} of {count} scenes finished, {len(aside)} put aside, "
        f"{count - len(finished) - len(aside)} to be made"
    ]
    lines += [
        f"scene {number} failed {each.attempts} times: {each.error} ({batch.failed.name}/{number:06d}.log)"
        for number, each in sorted(failures.items())[:_LISTED]
    ]
    if len(failures) > _LISTED:
        lines.append(f"and {len(failures) - _LISTED} more failed")
    if aside:
        lines.append(f"`ripple-sim batch {path} --retry-failed` tries them again")
    return "\n".join(lines)
