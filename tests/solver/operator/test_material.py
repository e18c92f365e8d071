"""Deformation models against theory, and GL against CPU for each of them."""

import numpy as np
import pytest
from modes import orders
from scipy.special import eval_legendre

from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver, sphere_atlas

DEGREES = (2, 4, 6)


def amplitude(material: Material, degree: int, time: float, n: int = 48) -> float:
    """What is left of a zonal mode that starts at rest with amplitude 1."""
    atlas = sphere_atlas(1.0, n)
    waves = WaveSolver(atlas, material, backend="cpu")
    mode = eval_legendre(degree, atlas.positions[..., 2])
    waves.height = mode
    waves.step(time)
    return float((atlas.areas * waves.height * mode).sum() / (atlas.areas * mode**2).sum())


PLATE = {"modulus": 2e5, "thickness": 0.05, "density": 800.0, "poisson": 0.25}
# stiffness of the plate over its mass per area
BENDING = 2e5 * 0.05**3 / 12 / (1 - 0.25**2) / (800.0 * 0.05)
DISPERSION = {
    "membrane": (Material.membrane(tension=18.0, density=2.0), lambda k2: 18.0 / 2.0 * k2),
    "plate": (Material.plate(**PLATE), lambda k2: BENDING * k2**2),
    "both on springs": (
        Material(speed=0.7, bending=0.02, stiffness=3.0),
        lambda k2: 0.7**2 * k2 + 0.02 * k2**2 + 3.0,
    ),
}


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("model", DISPERSION)
def test_frequencies_are_those_of_the_dispersion_relation(model: str, degree: int) -> None:
    material, square = DISPERSION[model]
    omega = np.sqrt(square(degree * (degree + 1)))
    # where the mode passes through zero its amplitude shows the error of the frequency: 0.02 is a
    # quarter of a per cent
    time = 2.5 * np.pi / omega if model == "membrane" else 2.25 * np.pi / omega
    bound = 0.05 if model == "plate" else 0.02
    assert amplitude(material, degree, time) == pytest.approx(np.cos(omega * time), abs=bound)


def test_plate_frequencies_converge_at_second_order() -> None:
    # a quarter of a period before the mode's zero the amplitude is steepest: it shows the error of
    # the frequency
    omega = np.sqrt(0.03) * 20
    errors = [
        abs(amplitude(Material(speed=0, bending=0.03), 4, 2.5 * np.pi / omega, n=n))
        for n in (16, 32, 64)
    ]
    assert (orders(errors) > 1.8).all()


def test_plate_conserves_energy_and_its_step_is_stable_and_close_to_the_limit(
    animal: Atlas,
) -> None:
    waves = WaveSolver(animal, Material.plate(thickness=0.002), backend="cpu")
    waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
    waves.step(5 * waves.stable_timestep)
    energy = waves.energy()
    waves.step(4000 * waves.stable_timestep)
    assert waves.energy() == pytest.approx(energy, rel=1e-4)
    waves._backend.advance(2000, 1.06 * waves.stable_timestep)
    assert not np.abs(waves._backend.fields.height()).max() < 1e3


@pytest.mark.parametrize("degree", [2, 4])
def test_stiffness_and_both_dampings_are_those_of_theory(degree: int) -> None:
    speed = 0.85
    nu = 0.0055
    across = 9.9
    square = degree * (degree + 1) + across
    rate = nu * square / 2
    omega = np.sqrt(speed**2 * square - rate**2)
    material = Material(speed=speed, stiffness=speed**2 * across, viscosity=nu, damping=nu * across)
    for time in (0.4, 1.7):
        decaying = np.exp(-rate * time) * (
            np.cos(omega * time) + rate / omega * np.sin(omega * time)
        )
        assert amplitude(material, degree, time, n=24) == pytest.approx(decaying, abs=0.015)
    assert abs(amplitude(material, degree, 200.0, n=16)) < 0.02


def test_a_dent_has_the_size_that_the_energy_beyond_the_yield_height_gives() -> None:
    k = 400.0
    limit = 0.01
    v = 1.0
    dent = Material.dent(limit, stiffness=k, speed=1.0, damping=0.0)
    waves = WaveSolver(sphere_atlas(1.0, 4), dent, backend="cpu", conserve_volume=False)
    waves.velocity = np.full((6, 4, 4), -v)
    for _ in range(1000):
        waves.step(0.001)
    # v^2 / 2 = k limit^2 / 2 + k limit depth
    depth = (v**2 / k - limit**2) / (2 * limit)
    np.testing.assert_allclose(waves.dent, -depth, rtol=0.01)
    # then it swings about the dent, no further than it can without yielding
    assert np.abs(waves.height - waves.dent).max() <= limit * (1 + 1e-6)


def test_dent_is_elastic_below_the_yield_height(animal: Atlas) -> None:
    heights = []
    for limit in (1.0, np.inf):
        waves = WaveSolver(animal, Material.dent(limit, stiffness=100.0, speed=0.4), backend="cpu")
        waves.add_impulse(animal.mesh.V[100], 1e-3, 0.06)
        waves.step(0.5)
        heights.append(waves.height)
        assert not waves.dent.any()
    np.testing.assert_array_equal(*heights)


def test_dent_stays_when_the_waves_have_died(animal: Atlas) -> None:
    waves = WaveSolver(
        animal, Material.dent(0.002, stiffness=100.0, speed=0.2, damping=8.0), backend="cpu"
    )
    waves.add_impulse(animal.mesh.V[100], 0.02, 0.06)
    waves.step(4.0)
    dent = waves.dent
    assert dent.min() < -0.001
    np.testing.assert_allclose(waves.height, dent, atol=1e-4)
    waves.add_height(np.zeros_like(dent))
    np.testing.assert_array_equal(waves.dent, dent)
    waves.reset()
    assert not waves.dent.any()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Material.plate(modulus=-1.0), "modulus must be .*, got -1.0 Pa"),
        (lambda: Material.plate(poisson=0.7), "poisson must be .*, got 0.7"),
        (lambda: Material.jelly(thickness=0.0), "thickness must be .*, got 0.0 m"),
        (
            lambda: Material.layer(1.0, thickness=[]),
            r"thickness must be .* at every texel, got \[\] m",
        ),
        (lambda: Material.membrane(tension=np.inf), "tension must be .*, got inf N/m"),
        (lambda: Material.dent(0.0), "yield_height must be .*, got 0 m"),
        (lambda: Material(viscosity=np.zeros((6, 4, 5))), "shape"),
    ],
)
def test_bad_materials_are_named(make, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        make()
