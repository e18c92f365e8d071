"""All that is hooked into MuJoCo or into objects of the user, with the reasons.

- A negative number in `data.solver_fwdinv[0]`, the mark: MuJoCo's data does not say that it was
  reset, and time alone does not tell. A reset wipes the mark out. `StepClock` reads it.
- `mujoco.mj_step` and `mujoco.mj_step2`, replaced within `followed` and put back after it: MuJoCo
  has no callback after a step, and an environment takes its steps itself.
- MuJoCo's handler of warnings, from `adopt_warnings` on: of itself MuJoCo writes warnings to
  standard error and to MUJOCO_LOG.TXT in the current folder.
- `mujoco.rollout.rollout` and `mujoco.rollout.Rollout.rollout`, replaced for good by
  `watch_rollouts`, which only programs with sensors of `add_sensor` call: a rollout takes its steps
  in C, where nobody steps the waves, and would return empty samples without a word.
- `step`, `reset` and `render` of a dm_control `Physics`, replaced for good by `hook_physics`: tasks
  and environments of dm_control call these methods, and need no change.

While `export/environment_renders.py` draws a frame of an environment, it replaces Gymnasium's and
MuJoCo's renderers; it puts them back after the frame.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import random
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import mujoco

from ripple_sim.errors import RippleWarning
from ripple_sim.solver.errors import warn_caller

# Where this flag is enabled, MuJoCo writes to `solver_fwdinv` itself.
_FWDINV = int(mujoco.mjtEnableBit.mjENBL_FWDINV)

# Nothing that is computed depends on the marks, so they may differ from run to run.
_random = random.SystemRandom()

# Functions of MuJoCo that finish a physics step.
_STEP_FUNCTIONS = ("mj_step", "mj_step2")

# Guards the two dictionaries below, and the replacing of MuJoCo's functions.
_lock = threading.Lock()
# Functions to call after a step, by the id of the data; who follows keeps the data alive.
_followers: dict[int, list[Callable[[], None]]] = {}
# MuJoCo's own functions by their names, while they are replaced.
_mujoco_functions: dict[str, Callable[..., None]] = {}

# Kinds of MuJoCo's warnings that were given already.
_given_kinds: set[str] = set()

# Warnings before rollouts that were given already.
_given_rollout_warnings: set[str] = set()


def can_be_marked(model: mujoco.MjModel) -> bool:
    """Whether MuJoCo leaves the place of the mark alone."""
    return not model.opt.enableflags & _FWDINV


def read_mark(data: mujoco.MjData) -> float | None:
    """The mark in the data, or None if it has none: it is new, or was reset."""
    mark = float(data.solver_fwdinv[0])
    return mark if mark < 0 else None


def make_mark(data: mujoco.MjData) -> float:
    """Give the data a new mark, and return it."""
    mark = -1.0 - _random.random()
    data.solver_fwdinv[0] = mark
    return mark


@contextlib.contextmanager
def followed(data: mujoco.MjData, after_step: Callable[[], None]) -> Iterator[None]:
    """Call a function after each physics step that anybody takes on this data within the context.

    Meanwhile `mujoco.mj_step` and `mujoco.mj_step2` are replaced by functions that do the same and
    then call the followers of their data. All code calls them, whatever framework it belongs to,
    except code that bound the functions to names of its own (`from mujoco import mj_step`).
    """
    _follow(data, after_step)
    try:
        yield
    finally:
        _unfollow(data, after_step)


def _follow(data: mujoco.MjData, after_step: Callable[[], None]) -> None:
    """Add a follower of the data; the first follower replaces MuJoCo's functions."""
    with _lock:
        if not _followers:
            for name in _STEP_FUNCTIONS:
                function = getattr(mujoco, name)
                _mujoco_functions[name] = function
                setattr(mujoco, name, _with_followers(function))
        _followers.setdefault(id(data), []).append(after_step)


def _unfollow(data: mujoco.MjData, after_step: Callable[[], None]) -> None:
    """Remove a follower of the data; the last follower puts MuJoCo's functions back."""
    with _lock:
        _followers[id(data)].remove(after_step)
        if not _followers[id(data)]:
            del _followers[id(data)]
        if not _followers:
            for name, function in _mujoco_functions.items():
                setattr(mujoco, name, function)


def _with_followers(function: Callable[..., None]) -> Callable[..., None]:
    """A function of MuJoCo that finishes steps, with the followers called after each step."""

    # with the names of MuJoCo's parameters
    def step(m: mujoco.MjModel, d: mujoco.MjData, *args: Any, **kwargs: Any) -> None:
        followers = _followers.get(id(d))
        if not followers:
            function(m, d, *args, **kwargs)
            return
        for _ in range(_step_count(*args, **kwargs)):
            function(m, d)
            for after_step in tuple(followers):
                after_step()

    return step


def _step_count(nstep: int = 1) -> int:
    """How many steps a call asks for."""
    return nstep


def adopt_warnings() -> None:
    """Give MuJoCo's warnings as `RippleWarning`, from now on, each kind once.

    A handler that the user has given to `mujoco.set_mju_user_warning` stays.
    """
    if mujoco.get_mju_user_warning() in (None, _give_warning):
        _given_kinds.clear()
        mujoco.set_mju_user_warning(_give_warning)


def _give_warning(message: str) -> None:
    """The function that MuJoCo calls with its warnings."""
    text = re.sub(r" *Time = [0-9.]+", "", " ".join(message.split()))
    kind = re.sub(r"[0-9]+", "", text)
    # an unstable simulation ends in an error, or begins anew with a warning
    if kind in _given_kinds or "simulation is unstable" in text:
        return
    _given_kinds.add(kind)
    with contextlib.suppress(RippleWarning):  # no exception can pass through MuJoCo
        warn_caller(f"MuJoCo: {text}")


def watch_rollouts(warning_of: Callable[[mujoco.MjModel], str]) -> None:
    """Warn before rollouts of MuJoCo, from now on, of each thing once.

    Parameters
    ----------
    warning_of : callable
        Returns the warning for a model, or "".
    """
    from mujoco import rollout  # takes 26 ms, which few programs need

    for owner in (rollout, rollout.Rollout):
        function = owner.rollout
        if not hasattr(function, "__wrapped__"):
            owner.rollout = _with_rollout_warning(function, warning_of)


def _with_rollout_warning(
    function: Callable[..., Any], warning_of: Callable[[mujoco.MjModel], str]
) -> Callable[..., Any]:
    """A rollout function of MuJoCo that warns first."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def rollout(*args: Any, **kwargs: Any) -> Any:
        models = signature.bind_partial(*args, **kwargs).arguments.get("model")
        # the models of a batch are alike
        model = models[0] if isinstance(models, Sequence) and models else models
        if isinstance(model, mujoco.MjModel):
            warning = warning_of(model)
            if warning and warning not in _given_rollout_warnings:
                _given_rollout_warnings.add(warning)
                warn_caller(warning)
        return function(*args, **kwargs)

    return rollout


def hook_physics(
    physics: Any,
    *,
    around_step: Callable[[], contextlib.AbstractContextManager[None]],
    after_reset: Callable[[], None],
    render: Callable[..., Any],
) -> None:
    """Replace methods of a dm_control `Physics`.

    Parameters
    ----------
    physics : dm_control.mujoco.Physics
    around_step : callable
        Returns a context manager, within which each `step` runs.
    after_reset : callable
        Called after each `reset`.
    render : callable
        Takes the place of `render`.
    """
    step = physics.step
    reset = physics.reset

    def hooked_step(*args: Any, **kwargs: Any) -> None:
        with around_step():
            step(*args, **kwargs)

    def hooked_reset(*args: Any, **kwargs: Any) -> None:
        reset(*args, **kwargs)
        after_reset()

    physics.step = hooked_step
    physics.reset = hooked_reset
    physics.render = render
