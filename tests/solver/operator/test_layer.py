"""A layer over a core, against the exact mode of an incompressible Kelvin-Voigt layer on a rigid base."""

import warnings

import numpy as np
import pytest
from hand_made import flat_torus

from ripple_sim import RippleWarning
from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.operator.material import lowest_square

MODULUS, VISCOSITY, DENSITY = 3000.0, 0.5, 1100.0
SQUARE, RELAXATION = MODULUS / DENSITY, VISCOSITY / MODULUS  # c_T^2 [m^2/s^2], eta / G [s]


def swung(q: float, thickness: float, periods: float) -> tuple[float, float]:
    """Frequency [1/s] and decay rate [1/s] of a standing wave on a flat layer, from its swing."""
    atlas = texel_atlas(flat_torus(32))
    material = Material.layer(MODULUS, VISCOSITY, DENSITY, thickness)
    waves = WaveSolver(atlas, material, backend="cpu")
    wave = np.cos(q * atlas.positions[..., 0])
    waves.height = wave
    dt = periods * 2 * np.pi / np.sqrt(SQUARE * lowest_square(q * thickness) / thickness**2) / 400
    swing = []
    for _ in range(400):
        waves.step(dt)
        swing.append(2 * float((waves.height * wave).mean()))
    # a damped swing obeys x_{n+1} = a x_n - b x_{n-1}, with a = 2 exp(-r dt) cos(w dt) and b = exp(-2 r dt)
    x = np.array(swing)
    (a, b), *_ = np.linalg.lstsq(np.stack([x[1:-1], -x[:-2]], axis=1), x[2:])
    return float(np.arccos(a / (2 * np.sqrt(b))) / dt), float(-np.log(b) / (2 * dt))


@pytest.mark.parametrize("depth", [1.3, 1.8, 2.5, 4.0, 6.0, 8.0])
def test_frequency_and_decay_of_a_standing_wave_are_those_of_the_exact_mode(depth: float) -> None:
    q = 4 * np.pi
    frequency, rate = swung(q, depth / q, periods=2)
    square = SQUARE * q**2 / depth**2 * lowest_square(depth)
    # the grid itself makes such a wave slower by half a per cent
    assert np.hypot(frequency, rate) == pytest.approx(np.sqrt(square), rel=0.035)
    assert rate == pytest.approx(square * RELAXATION / 2, rel=0.07)


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
    jelly, layer = Material.jelly(800.0, 3.0, 0.2, 900.0), Material.layer(800.0, 3.0, 900.0, 0.2)
    assert (jelly.speed, jelly.stiffness, jelly.damping) == (layer.speed, layer.stiffness, layer.damping)


@pytest.mark.parametrize(("thickness", "words"), [(1e-3, "take a resolution of"), (20.0, "take a thinner layer")])
def test_a_layer_whose_waves_the_atlas_has_no_room_for_is_warned_of(thickness: float, words: str) -> None:
    with pytest.warns(RippleWarning, match=words):
        WaveSolver(sphere_atlas(1.0, 16), Material.layer(MODULUS, thickness=thickness), backend="cpu")


def test_a_layer_that_suits_the_atlas_is_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        WaveSolver(sphere_atlas(1.0, 16), Material.layer(MODULUS, thickness=0.4), backend="cpu")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"modulus": 0.0}, "modulus is 0.0 Pa"),
        ({"modulus": 1.0, "viscosity": -1.0}, "viscosity is -1.0 Pa s"),
        ({"modulus": 1.0, "thickness": np.zeros((6, 4, 4))}, "thickness is 0.0 m"),
        ({"modulus": 1.0, "thickness": "thick"}, "thickness is 'thick' m"),
        ({"modulus": 1.0, "thickness": np.full((6, 4, 4), np.nan)}, "thickness is nan m"),
    ],
)
def test_senseless_layers_are_refused(parameters: dict, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        Material.layer(**parameters)
