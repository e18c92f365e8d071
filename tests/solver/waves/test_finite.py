"""Values that are not finite, or of the wrong kind, are named."""

import copy
import re
import warnings

import numpy as np
import pytest

from ripple_sim.solver import Material, RippleError, SolverError, WaveSolver, sphere_atlas


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda w: w.step(np.nan), "time step must be .*, got nan"),
        (lambda w: w.add_impulse([0, 0, 1], np.inf, 0.1), "impulse must be .*, got inf"),
        (lambda w: w.add_impulse([0, 0, 1], 1.0, -0.1), "radius must be .*, got -0.1"),
        (lambda w: w.add_impulse([0, 0, np.nan], 1.0, 0.1), "NaN"),
        (lambda w: w.add_impulse([0, 1], 1.0, 0.1), "shape"),
        (lambda w: setattr(w, "height", np.zeros((6, 4, 4))), "shape \\(6, 8, 8\\)"),
        (lambda w: setattr(w, "height", np.full((6, 8, 8), np.nan)), "NaN"),
        (lambda w: w.add_force([0, 0, 1], np.nan, 0.1), "force must be .*, got nan N"),
        (lambda w: w.add_pressure(np.inf), "pressure holds 384 values that are NaN or infinite"),
        (
            lambda w: w.add_height(np.zeros((6, 4, 4))),
            r"height must be one number or have shape \(6, 8, 8\), got \(6, 4, 4\)",
        ),
        (
            lambda w: w.add_impulse([[0, 0, 1], [0, 1, 0]], 1.0, 0.1),
            "a source must have one point.*, got 2 points",
        ),
        (lambda w: w.add_impulse([0, 0, 1], "hard", 0.1), "impulse must be .*, got 'hard' N s"),
        (lambda w: w.step("long"), "time step must be .*, got 'long' s"),
        (
            lambda w: w.step(0.1, substeps=[]),
            r"substeps must be a whole number, 1 or greater, up to 1000000, .*, got \[\]",
        ),
        (lambda w: w.step(0.1, substeps=10**400), r"substeps must be a whole number.*, got 1000"),
        (
            lambda w: w.add_pressure([1.0, 2.0]),
            r"pressure must be one number or have shape \(6, 8, 8\), got \(2,\)",
        ),
    ],
)
def test_invalid_values_are_refused_with_their_names(call, message: str) -> None:
    with pytest.raises(RippleError, match=message):
        call(WaveSolver(sphere_atlas(1.0, 8), backend="cpu"))


def test_values_that_are_not_finite_are_reported_with_place_and_time(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    waves = WaveSolver(atlas, backend=backend)
    waves.step(0.5)
    height = np.zeros((6, 16, 16), np.float32)
    height[2, 5, 9] = np.nan
    waves._backend.fields.set_height(height)
    place = atlas.positions[2, 5, 9]
    expected = (
        rf"chart 2, row 5, column 9, \({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g}\) m "
        rf".* time 0\.6 s"
    )
    with pytest.raises(SolverError, match=expected):
        waves.step(0.1)
        _ = waves.height
    waves.reset()
    waves.step(0.1)
    assert not waves.height.any()


STRIPES = np.broadcast_to(3e38 * (-1.0) ** np.arange(8), (6, 8, 8))
SOURCES = {
    "impulse of 8e+37 N s": lambda w: [w.add_impulse([0, 0, 1], 8e37, 0.5) for _ in range(3)],
    "forces of 1e+40 N": lambda w: w.add_force([0, 0, 1], 1e40, 0.5),
    "height of 3e+38 m": lambda w: setattr(w, "height", STRIPES),
    "velocity of 3e+38 m/s": lambda w: setattr(w, "velocity", STRIPES),
}


@pytest.mark.parametrize("source", SOURCES)
def test_the_error_names_the_source_and_comes_without_a_look_of_the_users(source: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu", conserve_volume=False)
    waves.add_impulse([1, 0, 0], 1.0, 0.5)
    waves.step(0.1)
    with warnings.catch_warnings(action="error"):
        SOURCES[source](waves)
        with pytest.raises(
            SolverError, match=re.escape(f"the largest source is the {source} at time 0.1 s")
        ):
            for _ in range(32):
                waves.step(waves.stable_timestep)


READ = {
    "height": lambda w: w.height,
    "velocity": lambda w: w.velocity,
    "energy": lambda w: w.energy(),
    "volume": lambda w: w.volume(),
    "momentum": lambda w: w.momentum(),
    "state": lambda w: w.state,
    "copy": copy.copy,
}


@pytest.mark.parametrize("name", READ)
def test_reading_values_that_are_not_finite_is_an_error(name: str, backend: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend=backend)
    waves._backend.fields.set_height(np.full((6, 8, 8), np.nan, np.float32))
    waves._backend.set_velocity(np.full((6, 8, 8), np.nan, np.float32))
    with pytest.raises(SolverError, match=r"no longer finite .* no source was given"):
        READ[name](waves)


def test_an_impulse_beyond_float32_is_refused_and_changes_nothing() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(
        SolverError,
        match=r"impulse is 1e\+300 N s, which would move the surface at .* beyond float32",
    ):
        waves.add_impulse([0, 0, 1], 1e300, 0.5)
    waves.step(0.1)
    assert not waves.height.any()


def test_a_step_whose_coefficients_are_beyond_float32_is_refused() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), Material(speed=1e-40), backend="cpu")
    with pytest.raises(
        SolverError, match=r"a substep of 1e\+39 s on texels of .* kg and more is beyond float32"
    ):
        waves.step(1e39)


def test_a_velocity_that_is_not_finite_is_reported_before_the_height_is_affected(
    backend: str,
) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend=backend)
    velocity = np.zeros((6, 8, 8), np.float32)
    velocity[1, 2, 3] = np.inf
    waves._backend.set_velocity(velocity)
    with pytest.raises(
        SolverError, match="velocity is no longer finite at chart 1, row 2, column 3"
    ):
        _ = waves.velocity
    assert not waves.height.any()
