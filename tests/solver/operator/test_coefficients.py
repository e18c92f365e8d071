"""Limits of the coefficients, and a layer over a core against the exact mode."""

import runpy
import warnings
from pathlib import Path

import numpy as np
import pytest
from hand_made import flat_torus
from modes import swing

from ripple_sim import RippleWarning
from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.operator import LIMITS, check_mask, check_numbers, frequency

STRICT = ("density", "yield_height")


@pytest.mark.parametrize("name", LIMITS)
def test_the_least_and_the_greatest_value_are_allowed(name: str) -> None:
    check_numbers(name, 1e-12 if name in STRICT else 0)
    check_numbers(name, 1e12)
    check_numbers(name, np.full((6, 4, 4), 0.5))


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize("value", [-1e-300, -np.inf, np.inf, np.nan, 1.0000001e12])
def test_values_beyond_the_limits_are_refused_with_their_unit(name: str, value: float) -> None:
    unit, _, endless = LIMITS[name]
    if value == np.inf and endless:
        return
    with pytest.raises(SolverError) as refused:
        check_numbers(name, value)
    assert f"material {name} must be a finite number" in str(refused.value)
    assert f"got {value:g} {unit}" in str(refused.value)


FIRST_WRONG = np.array([[[1.0, -2.5], [np.nan, 1.0]]])


@pytest.mark.parametrize(
    ("check", "name", "value", "said"),
    [
        *(
            (
                check_numbers,
                name,
                0.0,
                f"{name} must be .*greater than 0 and at least 1e-12, up to 1e.*, got 0 ",
            )
            for name in STRICT
        ),
        *(
            (
                check_numbers,
                name,
                1e-13,
                f"{name} must be .*greater than 0 and at least 1e-12.*, got 1e-13 ",
            )
            for name in STRICT
        ),
        (check_numbers, "density", np.inf, "density must (?!.*or infinity).*, got inf"),
        (
            check_numbers,
            "speed",
            FIRST_WRONG,
            r"speed must be a finite number, 0 or greater, up to 1e.*, got -2\.5 m/s",
        ),
        *(
            (check_mask, "fixed", value, "must be False or a bool mask .*, got type")
            for value in (0, 1.0, "yes", np.ones((6, 4, 4), "i1"))
        ),
    ],
)
def test_invalid_coefficients_are_refused_with_the_expected_values(
    check, name: str, value: object, said: str
) -> None:
    check_numbers("yield_height", np.inf)  # alone may be infinite
    with pytest.raises(SolverError, match=said):
        check(name, value)


@pytest.mark.parametrize("shape", [(3,), (4, 4), (6, 4, 5), (6, 4, 4, 1)])
def test_arrays_that_are_no_charts_are_named_by_their_shape(shape: tuple[int, ...]) -> None:
    for check, values in ((check_numbers, np.ones(shape)), (check_mask, np.ones(shape, bool))):
        with pytest.raises(
            SolverError, match=r"must be a number or have shape \[C, n, n\].*, got shape"
        ) as refused:
            check("damping", values)
        assert str(shape) in str(refused.value)


# which the plots compare with as well
EXACT = runpy.run_path(str(Path(__file__).parents[3] / "examples" / "plots" / "layer_mode.py"))
lowest_square = EXACT["lowest_square"]
group_speed = EXACT["group_speed"]
MODULUS = 3000.0
VISCOSITY = 0.5
DENSITY = 1100.0
# c_T^2 [m^2/s^2], eta / G [s]
SQUARE = MODULUS / DENSITY
RELAXATION = VISCOSITY / MODULUS


@pytest.mark.parametrize(
    ("depth", "short"),
    [*((depth, False) for depth in (1.3, 1.8, 2.5, 4.0, 6.0, 8.0)), (5.0, True), (12.0, True)],
)
def test_frequency_and_decay_of_a_standing_wave_are_those_of_the_exact_mode(
    depth: float, short: bool
) -> None:
    q = 4 * np.pi
    atlas = texel_atlas(flat_torus(32))
    waves = WaveSolver(
        atlas, Material.layer(MODULUS, VISCOSITY, DENSITY, depth / q, short), backend="cpu"
    )
    dt = 2 * 2 * np.pi / np.sqrt(SQUARE * lowest_square(depth) * (q / depth) ** 2) / 400
    frequency, rate = swing(waves, np.cos(q * atlas.positions[..., 0]), dt, 400)
    square = SQUARE * q**2 / depth**2 * lowest_square(depth)
    # the grid itself makes such a wave slower by half a per cent
    assert np.hypot(frequency, rate) == pytest.approx(np.sqrt(square), rel=0.035)
    assert rate == pytest.approx(square * RELAXATION / 2, rel=0.07)


def test_short_waves_have_the_phase_and_group_speed_of_the_exact_mode() -> None:
    material = Material.layer(1.0, 0.0, 1.0, 1.0, short=True)
    step = 1e-3
    for q in (5.0, 6.5, 9.0, 14.0, 25.0, 40.0):
        below, here, above = (frequency(material, q + d) for d in (-step, 0, step))
        assert here == pytest.approx(np.sqrt(lowest_square(q)), rel=0.03)
        assert (above - below) / (2 * step) == pytest.approx(group_speed(q), rel=0.04)


def test_a_thin_layer_is_stiffer_and_sooner_still_than_a_thick_one() -> None:
    shape = (6, 8, 8)
    thickness = np.linspace(0.01, 0.03, 384).reshape(shape)
    field = Material.layer(MODULUS, VISCOSITY, DENSITY, thickness)
    for texel in ((0, 0, 0), (2, 3, 4), (5, 7, 7)):
        alone = Material.layer(MODULUS, VISCOSITY, DENSITY, thickness[texel])
        for name in ("speed", "damping", "stiffness", "viscosity", "density"):
            assert field.texels(name, shape)[texel] == pytest.approx(getattr(alone, name))
    assert np.all(np.diff(np.ravel(field.damping)) < 0)


def test_jelly_is_a_layer() -> None:
    jelly = Material.jelly(800.0, 3.0, 0.2, 900.0)
    layer = Material.layer(800.0, 3.0, 900.0, 0.2)
    assert (jelly.speed, jelly.stiffness, jelly.damping) == (
        layer.speed,
        layer.stiffness,
        layer.damping,
    )


@pytest.mark.parametrize(
    ("thickness", "words"), [(1e-3, "take a resolution of"), (20.0, "take a thinner layer")]
)
def test_a_layer_whose_waves_the_atlas_has_no_room_for_is_warned_of(
    thickness: float, words: str
) -> None:
    with pytest.warns(RippleWarning, match=words):
        WaveSolver(
            sphere_atlas(1.0, 16), Material.layer(MODULUS, thickness=thickness), backend="cpu"
        )


def test_a_layer_that_suits_the_atlas_is_not_warned_of() -> None:
    with warnings.catch_warnings(action="error"):
        WaveSolver(sphere_atlas(1.0, 16), Material.layer(MODULUS, thickness=0.4), backend="cpu")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"modulus": 0.0}, "modulus must be .*, got 0.0 Pa"),
        ({"modulus": 1.0, "viscosity": -1.0}, "viscosity must be .*, got -1.0 Pa s"),
        ({"modulus": 1.0, "thickness": np.zeros((6, 4, 4))}, "thickness must be .*, got 0.0 m"),
        ({"modulus": 1.0, "thickness": "thick"}, "thickness must be .*, got 'thick' m"),
        (
            {"modulus": 1.0, "thickness": np.full((6, 4, 4), np.nan)},
            "thickness must be .*, got nan m",
        ),
    ],
)
def test_senseless_layers_are_refused(parameters: dict, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        Material.layer(**parameters)


def test_short_waves_do_not_feel_the_base_and_run_as_rayleigh_s_and_long_ones_run_faster() -> None:
    """The surface speed on an incompressible half space is 0.9553 c_T.

    x = (c / c_T)^2 solves x^3 - 8 x^2 + 24 x - 16 = 0.
    """
    rayleigh = min(root.real for root in np.roots([1, -8, 24, -16]) if abs(root.imag) < 1e-9)
    assert np.sqrt(lowest_square(10.0)) / 10.0 == pytest.approx(np.sqrt(rayleigh), rel=2e-3)
    # long waves do, and run faster
    speeds = [np.sqrt(lowest_square(q)) / q for q in (1.3, 2.0, 4.0, 8.0)]
    assert np.all(np.diff(speeds) < 0)
    assert speeds[0] > 2
