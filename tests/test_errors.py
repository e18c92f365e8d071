"""One `except RippleError` catches all that ripple-sim raises on purpose, and nothing else."""

import inspect

import pytest

import ripple_sim
from ripple_sim import errors as of_application
from ripple_sim.errors import RenderError, SceneError
from ripple_sim.solver import errors as of_solver
from ripple_sim.solver.errors import GLError, RippleError, deprecated

MEMBERS = [each for module in (of_solver, of_application) for _, each in inspect.getmembers(module, inspect.isclass)]
CLASSES = sorted({each for each in MEMBERS if issubclass(each, Exception)}, key=lambda each: each.__name__)
ERRORS = [each for each in CLASSES if not issubclass(each, Warning)]


def test_there_is_one_root_for_the_solver_and_the_application() -> None:
    assert of_application.RippleError is of_solver.RippleError is ripple_sim.RippleError
    assert len(ERRORS) >= 10


@pytest.mark.parametrize("error", ERRORS, ids=lambda each: each.__name__)
def test_every_error_is_caught_as_a_ripple_error_and_keeps_its_message(error: type[RippleError]) -> None:
    with pytest.raises(RippleError, match=r"^height is nan; valid are numbers$"):
        raise error("height is nan; valid are numbers")
    # a mistake in the code itself must not look like one of the user; two are also what mujoco.Renderer raises
    others = {RippleError: (Exception,), RenderError: (SceneError, ValueError), GLError: (RippleError, RuntimeError)}
    assert error.__bases__ == others.get(error, (RippleError,))


def test_a_warning_is_no_error_so_that_the_program_goes_on() -> None:
    assert issubclass(of_application.RippleWarning, UserWarning)
    assert not issubclass(of_application.RippleWarning, RippleError)


def test_what_is_deprecated_works_and_warns_where_it_is_used() -> None:
    def old_name() -> int:
        deprecated("old_name", "new_name", "2.0")
        return 1

    with pytest.warns(DeprecationWarning, match=r"^old_name is deprecated and goes with 2.0; use new_name$") as told:
        assert old_name() == 1
    assert told[0].filename == __file__
