"""What MuJoCo itself says: its warnings as ours, and its errors with what helps."""

from __future__ import annotations

import contextlib
import re
import warnings
from collections.abc import Iterator

import mujoco

from ripple_sim.errors import RippleWarning, SimulationError


def adopt_warnings() -> None:
    """Have MuJoCo's warnings given as `RippleWarning`, from now on, each once.

    Of itself it writes them to standard error and to MUJOCO_LOG.TXT in the current folder. A handler that the user has
    given to `mujoco.set_mju_user_warning` stays.
    """
    handler = mujoco.get_mju_user_warning()
    if handler is None or isinstance(handler, _Warner):
        mujoco.set_mju_user_warning(_Warner())


class _Warner:
    """What MuJoCo calls with its warnings."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def __call__(self, message: str) -> None:
        text = re.sub(r" *Time = [0-9.]+", "", " ".join(message.split()))
        kind = re.sub(r"[0-9]+", "", text)
        # an unstable simulation ends in an error, or begins anew with a warning
        if kind in self._said or "simulation is unstable" in text:
            return
        self._said.add(kind)
        with contextlib.suppress(RippleWarning):  # no exception can pass through MuJoCo
            warnings.warn(f"MuJoCo: {text}", RippleWarning, stacklevel=2)


@contextlib.contextmanager
def physics_errors() -> Iterator[None]:
    """Turn MuJoCo's errors into a `SimulationError`: above all, too little memory for the contacts of many bodies."""
    try:
        yield
    except mujoco.FatalError as error:
        reason = " ".join(str(error).split())
        advice = '; enlarge <size memory="..."/> in the MJCF' if "memory" in reason or "stack" in reason else ""
        raise SimulationError(f"MuJoCo cannot go on: {reason}{advice}") from error
