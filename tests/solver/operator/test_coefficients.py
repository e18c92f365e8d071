"""Limits of the coefficients: what is allowed, and what the messages say."""

import numpy as np
import pytest

from ripple_sim.solver import SolverError
from ripple_sim.solver.operator.coefficients import LIMITS, check_mask, check_numbers, require_positive

STRICT = ("density", "yield_height")


@pytest.mark.parametrize("name", LIMITS)
def test_the_least_and_the_greatest_value_are_allowed(name: str) -> None:
    check_numbers(name, 1e-12 if name in STRICT else 0)
    check_numbers(name, 1e12)
    check_numbers(name, np.full((6, 4, 4), 0.5))


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize("value", [-1e-300, -np.inf, np.nan, 1.0000001e12])
def test_values_beyond_the_limits_are_refused_with_their_unit(name: str, value: float) -> None:
    unit = LIMITS[name][0]
    with pytest.raises(SolverError) as refused:
        check_numbers(name, value)
    assert f"material {name} is {value:g} {unit}; valid is a finite number" in str(refused.value)


@pytest.mark.parametrize("name", STRICT)
@pytest.mark.parametrize("value", [0.0, 1e-13])
def test_what_is_divided_by_must_not_come_near_0(name: str, value: float) -> None:
    with pytest.raises(SolverError, match=f"{name} is {value:g} .*greater than 0 and at least 1e-12, up to 1e"):
        check_numbers(name, value)


@pytest.mark.parametrize("name", LIMITS)
def test_only_the_yield_height_may_be_infinite(name: str) -> None:
    if name == "yield_height":
        check_numbers(name, np.inf)
        return
    with pytest.raises(SolverError, match="is inf ") as refused:
        check_numbers(name, np.inf)
    assert "or infinity" not in str(refused.value)


def test_the_first_wrong_texel_is_the_one_that_is_named() -> None:
    speed = np.ones((2, 4, 4))
    speed[0, 3, 3], speed[1, 0, 1] = -2.5, np.nan
    with pytest.raises(SolverError, match=r"speed is -2\.5 m/s; valid is a finite number, 0 or greater, up to 1e"):
        check_numbers("speed", speed)


@pytest.mark.parametrize("shape", [(3,), (4, 4), (6, 4, 5), (6, 4, 4, 1)])
def test_arrays_that_are_no_charts_are_named_by_their_shape(shape: tuple[int, ...]) -> None:
    for check, values in ((check_numbers, np.ones(shape)), (check_mask, np.ones(shape, bool))):
        with pytest.raises(SolverError, match=r"has shape \(.*\); valid is a number or \[C, n, n\]") as refused:
            check("damping", values)
        assert str(shape) in str(refused.value)


@pytest.mark.parametrize("value", ["fast", [1.0, [2.0]], None, {"x": 1}, 1j])
def test_what_is_no_number_is_named(value: object) -> None:
    with pytest.raises(SolverError, match=r"material stiffness is .*valid is a"):
        check_numbers("stiffness", value)


@pytest.mark.parametrize("value", [0, 1.0, "yes", np.ones((6, 4, 4), np.int8)])
def test_numbers_are_no_mask(value: object) -> None:
    with pytest.raises(SolverError, match=r"material fixed has type .*; valid is bool"):
        check_mask("fixed", value)


def test_a_mask_is_one_bool_or_one_a_texel() -> None:
    for value in (True, np.False_, np.zeros((5, 4, 4), bool)):
        check_mask("fixed", value)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, -np.inf, np.nan])
def test_the_value_that_is_not_positive_is_named_among_several(value: float) -> None:
    require_positive(modulus=(1e-300, "Pa"), density=(1e300, "kg/m^3"))
    with pytest.raises(SolverError) as refused:
        require_positive(modulus=(1.0, "Pa"), thickness=(value, "m"))
    assert str(refused.value) == f"thickness is {value!r} m; valid is a finite number greater than 0"
