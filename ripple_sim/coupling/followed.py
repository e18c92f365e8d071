"""Steps that other code takes, such as an environment's `step`, seen one by one, when their forces are known."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

import mujoco

_FINISH_A_STEP = ("mj_step", "mj_step2")

_lock = threading.Lock()
# By the id of the data; who follows keeps the data alive.
_followers: dict[int, list[Callable[[], None]]] = {}
_mujoco_functions: dict[str, Callable[..., None]] = {}


@contextlib.contextmanager
def followed(data: mujoco.MjData, after_step: Callable[[], None]) -> Iterator[None]:
    """Call a function after each physics step that anybody takes on this data within the context.

    While somebody follows, `mujoco.mj_step` and `mujoco.mj_step2` are replaced by functions that do the same and then
    call the followers of their data. MuJoCo has no callback after a step; this is the one place that all code passes,
    whatever framework it belongs to, but for code that bound the functions to names of its own (`from mujoco import
    mj_step`).
    """
    with _lock:
        if not _followers:
            _replace()
        _followers.setdefault(id(data), []).append(after_step)
    try:
        yield
    finally:
        with _lock:
            _followers[id(data)].remove(after_step)
            if not _followers[id(data)]:
                del _followers[id(data)]
            if not _followers:
                _restore()


def _replace() -> None:
    for name in _FINISH_A_STEP:
        _mujoco_functions[name] = getattr(mujoco, name)
        setattr(mujoco, name, _following(_mujoco_functions[name]))


def _restore() -> None:
    for name in _FINISH_A_STEP:
        setattr(mujoco, name, _mujoco_functions.pop(name))


def _following(function: Callable[..., None]) -> Callable[..., None]:
    """The same function, which calls the followers after each step."""

    def step(m: mujoco.MjModel, d: mujoco.MjData, *args: Any, **kwargs: Any) -> None:
        followers = _followers.get(id(d))
        if not followers:
            function(m, d, *args, **kwargs)
            return
        for _ in range(_count(*args, **kwargs)):
            function(m, d)
            for follow in tuple(followers):
                follow()

    return step


def _count(nstep: int = 1) -> int:
    """How many steps a call asks for."""
    return nstep
