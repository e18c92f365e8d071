"""The wave operators that a video shows side by side, and their titles."""

from __future__ import annotations

from ripple_sim.errors import SceneError

OWN = "fem"  # the wave operator of ripple-sim

# Title and remark, by wave operator.
TITLES = {
    OWN: ("ripple-sim", "finite elements"),
    "paper": ("paper", "real distances, 4 neighbours"),
    "uncorrected": ("uncorrected", "one distance everywhere"),
    "dynamic-paint": ("Dynamic Paint", "real distances, 8 neighbours"),
}
BASELINES = tuple(name for name in TITLES if name != OWN)


def compared_operators(baseline: str | None) -> tuple[str, ...]:
    """Wave operators of the runs of a video: our own, and a baseline if given.

    Raises `SceneError` for an unknown baseline.
    """
    if baseline is None:
        return (OWN,)
    if baseline not in BASELINES:
        raise SceneError(
            f"the operator to compare with must be one of {', '.join(BASELINES)}, got {baseline!r}"
        )
    return OWN, baseline
