"""One `except RippleError` catches all that ripple-sim raises on purpose, and nothing else."""

import functools
import inspect
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import ripple_sim
from ripple_sim import errors as of_application
from ripple_sim.errors import RenderError, RippleWarning, SceneError
from ripple_sim.solver import errors as of_solver
from ripple_sim.solver.errors import (
    GLError,
    RippleError,
    deprecated,
    user_line,
    warn_caller,
    work_for,
)

MEMBERS = [
    each
    for module in (of_solver, of_application)
    for _, each in inspect.getmembers(module, inspect.isclass)
]
CLASSES = sorted(
    {each for each in MEMBERS if issubclass(each, Exception)}, key=lambda each: each.__name__
)
ERRORS = [each for each in CLASSES if not issubclass(each, Warning)]


def test_there_is_one_root_for_the_solver_and_the_application() -> None:
    assert of_application.RippleError is of_solver.RippleError is ripple_sim.RippleError
    assert len(ERRORS) >= 10


@pytest.mark.parametrize("error", ERRORS, ids=lambda each: each.__name__)
def test_every_error_is_caught_as_a_ripple_error_and_keeps_its_message(
    error: type[RippleError],
) -> None:
    with pytest.raises(RippleError, match=r"^height must be a number, got nan$"):
        raise error("height must be a number, got nan")
    # a mistake in the code itself must not look like one of the user; two are also what
    # mujoco.Renderer raises
    others = {
        RippleError: (Exception,),
        RenderError: (SceneError, ValueError),
        GLError: (RippleError, RuntimeError),
    }
    assert error.__bases__ == others.get(error, (RippleError,))


def test_a_warning_does_not_end_the_program() -> None:
    assert issubclass(of_application.RippleWarning, UserWarning)
    assert not issubclass(of_application.RippleWarning, RippleError)


def test_deprecated_names_work_and_warn_at_the_users_line() -> None:
    def old_name() -> int:
        deprecated("old_name", "new_name", "2.0")
        return 1

    with pytest.warns(
        DeprecationWarning, match=r"^old_name is deprecated and goes with 2.0; use new_name$"
    ) as told:
        assert old_name() == 1
    assert told[0].filename == __file__


def in_a_thread(work: Callable[[], None], *begin: Any) -> None:
    """Run work in a thread, with what begins it."""
    initializer, *arguments = begin or (None,)
    with ThreadPoolExecutor(1, initializer=initializer, initargs=tuple(arguments)) as pool:
        pool.submit(work).result()


def test_a_warning_of_a_thread_names_the_line_that_gave_it_the_work() -> None:
    line = user_line()
    # a function of the package's own, on whose thread no frame is the user's
    warn = functools.partial(warn_caller, "the surface is still")
    with pytest.warns(RippleWarning, match="the surface is still") as told:
        in_a_thread(warn, work_for, line)
    assert (told[0].filename, told[0].lineno) == line
    assert line[0] == __file__


def test_a_warning_of_a_users_function_in_a_thread_names_the_function() -> None:
    def on_step() -> None:
        warn_caller("the poke is far off")

    with pytest.warns(RippleWarning, match="the poke is far off") as told:
        in_a_thread(on_step, work_for, ("elsewhere.py", 1))
    assert told[0].filename == __file__


def test_no_module_counts_frames_for_a_warning_by_itself() -> None:
    root = Path(of_solver.__file__).parents[1]
    modules = [
        path for folder in ("ripple_sim", "solver") for path in (root / folder).rglob("*.py")
    ]
    assert len(modules) > 100
    counting = [
        path.name for path in modules if "warnings.warn(" in path.read_text(encoding="utf-8")
    ]
    assert counting == ["errors.py"]
