"""A surface at rest under pressing bodies: against series, energy and conditions of contact."""

import numpy as np
import pytest
from hand_made import square

from ripple_sim.solver import (
    Material,
    SolverError,
    WaveSolver,
    sphere_atlas,
    texel_atlas,
)
from ripple_sim.solver.operator.modes import elastic_matrix

DENSITY = 2.0  # [kg/m^2]
SPEED = 3.0  # [m/s]
TENSION = DENSITY * SPEED**2  # [N/m]


@pytest.fixture(scope="module")
def pad() -> WaveSolver:
    """A square membrane of side 1 that is held at its rim."""
    material = Material(speed=SPEED, density=DENSITY)
    return WaveSolver(texel_atlas(square(48)), material, backend="cpu", rim="supported")


def series(place: np.ndarray, source: np.ndarray, terms: int = 400) -> np.ndarray:
    """Height of the square membrane under 1 N at a point, by the sine series of the square."""
    k = np.pi * np.arange(1, terms + 1)
    x = np.sin(place[:, :1] * k) * np.sin(source[0] * k)
    y = np.sin(place[:, 1:2] * k) * np.sin(source[1] * k)
    return -4 / TENSION * np.einsum("pm,pn,mn->p", x, y, 1 / (k[:, None] ** 2 + k**2))


def test_point_force_on_a_held_square_gives_the_height_of_the_series(pad: WaveSolver) -> None:
    source = np.array([0.4, 0.55, 0.0])
    imprint = pad.press(source, forces=0.7, radius=0.06)
    places = pad.atlas.positions.reshape(-1, 3)
    away = np.linalg.norm(places - source, axis=1)
    # beyond the footprint a smooth load round a point acts like the point, by the mean-value law
    outside = np.flatnonzero((away > 0.1) & (away < 0.3))
    expected = 0.7 * series(places[outside], source)
    np.testing.assert_allclose(imprint.height.reshape(-1)[outside], expected, rtol=0.01)


@pytest.mark.parametrize("given", ["forces", "depths"])
def test_pressure_adds_up_to_the_forces(pad: WaveSolver, given: str) -> None:
    points = np.random.default_rng(0).uniform(0.2, 0.8, (20, 3)) * [1, 1, 0]
    values = np.random.default_rng(1).uniform(0.01, 0.02, 20)
    imprint = pad.press(points, radius=0.05, **{given: values})
    total = (imprint.pressure * pad.atlas.areas).sum()
    assert total == pytest.approx(imprint.forces.sum(), rel=1e-12)
    if given == "forces":
        np.testing.assert_array_equal(imprint.forces, values)


def test_forces_are_in_balance_with_tension_everywhere(pad: WaveSolver) -> None:
    points = [[0.3, 0.3, 0.0], [0.7, 0.6, 0.0]]
    imprint = pad.press(points, forces=[1.0, -0.5], radius=0.1)
    pull = elastic_matrix(pad.operator) @ imprint.height.reshape(-1)
    load = -(imprint.pressure * pad.atlas.areas).reshape(-1)
    free = pad.operator.free.reshape(-1)
    np.testing.assert_allclose(pull[free], load[free], atol=1e-12)


def test_body_presses_to_its_depth_and_never_pulls(pad: WaveSolver) -> None:
    x, y = np.meshgrid(np.linspace(0.2, 0.8, 16), np.linspace(0.2, 0.8, 16))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    from_middle = np.hypot(x - 0.5, y - 0.5).ravel()
    depths = 0.02 - from_middle**2  # of a ball of radius 0.5
    imprint = pad.press(points, depths=depths, radius=0.05)
    stamp = pad._stamps._stamp
    reached = -(stamp._shares.T @ imprint.height.reshape(-1))
    touched = depths > 0
    pressed = imprint.forces > 0
    assert (imprint.forces >= 0).all()
    assert not pressed[~touched].any()
    np.testing.assert_allclose(reached[pressed], depths[pressed], rtol=1e-7)
    assert (reached[touched] >= depths[touched] - 1e-9).all()
    assert 4 < pressed.sum() < touched.sum()  # the skin leaves the ball before its depth is 0


def test_twice_as_deep_needs_twice_the_force(pad: WaveSolver) -> None:
    points = [[0.4, 0.5, 0.0], [0.6, 0.5, 0.0], [0.6, 0.5, 0.0]]  # one of them twice
    depths = np.array([0.01, 0.02, 0.02])
    once = pad.press(points, depths=depths)
    twice = pad.press(points, depths=2 * depths)
    np.testing.assert_allclose(twice.height, 2 * once.height, atol=1e-12)
    np.testing.assert_allclose(
        once.forces[1:].sum(), pad.press(points[:2], depths=depths[:2]).forces[1]
    )


def test_closed_surface_keeps_its_volume_and_bulges_round_a_finger() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 16), Material(speed=SPEED, density=DENSITY), backend="cpu")
    imprint = waves.press((0, 0, 1), forces=1.0, radius=0.4)
    assert abs((imprint.height * waves.atlas.areas).sum()) < 1e-12
    up = waves.atlas.positions[..., 2]
    assert imprint.height[up > 0.98].mean() < 0 < imprint.height[up < 0].mean()


def test_soft_foundation_carries_an_even_pressure_alone() -> None:
    """Winkler's foundation: pressure over stiffness, for a texel's force on a free sheet."""
    stiffness = 5.0
    atlas = texel_atlas(square(6))
    material = Material(speed=0.0, density=DENSITY, stiffness=stiffness)
    waves = WaveSolver(atlas, material, backend="cpu", conserve_volume=False)
    imprint = waves.press(atlas.positions[0, 2, 3], forces=0.3)
    np.testing.assert_allclose(imprint.height, -imprint.pressure / (DENSITY * stiffness))


def test_surface_that_nothing_holds_is_refused() -> None:
    waves = WaveSolver(
        sphere_atlas(1.0, 8), Material(speed=1.0), backend="cpu", conserve_volume=False
    )
    with pytest.raises(SolverError, match="nothing holds the surface"):
        waves.press((0, 0, 1), forces=1.0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({}, "either forces or depths"),
        ({"forces": 1.0, "depths": 1.0}, "either forces or depths"),
        ({"forces": [1.0, 2.0]}, "forces must be finite: one number, or one for each of 1 points"),
        ({"depths": np.nan}, "depths must be finite"),
        ({"forces": 1.0, "radius": -1.0}, "radius must be a finite number"),
    ],
)
def test_wrong_presses_are_refused(pad: WaveSolver, wrong: dict, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        pad.press((0.5, 0.5, 0.0), **wrong)


def test_waves_stay_as_they_are(pad: WaveSolver) -> None:
    before = pad.height
    pad.press((0.5, 0.5, 0.0), forces=1.0)
    np.testing.assert_array_equal(pad.height, before)
