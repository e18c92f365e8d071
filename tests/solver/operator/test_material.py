"""Deformation models against theory, and GL against CPU for each of them."""

import numpy as np
import pytest

from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver, sphere_atlas

LEGENDRE = {
    2: lambda z: (3 * z**2 - 1) / 2,
    4: lambda z: (35 * z**4 - 30 * z**2 + 3) / 8,
    6: lambda z: (231 * z**6 - 315 * z**4 + 105 * z**2 - 5) / 16,
}


def amplitude(material: Material, degree: int, time: float, backend: str = "cpu", n: int = 48) -> float:
    """What is left of a zonal mode that starts at rest with amplitude 1."""
    atlas = sphere_atlas(1.0, n)
    waves = WaveSolver(atlas, material, backend=backend)
    mode = LEGENDRE[degree](atlas.positions[..., 2])
    waves.height = mode
    waves.step(time)
    return float((atlas.areas * waves.height * mode).sum() / (atlas.areas * mode**2).sum())


def decaying(omega0: float, rate: float, time: float) -> float:
    omega = np.sqrt(omega0**2 - rate**2)
    return np.exp(-rate * time) * (np.cos(omega * time) + rate / omega * np.sin(omega * time))


@pytest.mark.parametrize("degree", LEGENDRE)
def test_membrane_speed_is_root_of_tension_over_density(degree: int) -> None:
    omega = np.sqrt(18.0 / 2.0 * degree * (degree + 1))
    # where the mode passes through zero its amplitude shows the error of the frequency: 0.02 is a quarter of a per cent
    assert abs(amplitude(Material.membrane(tension=18.0, density=2.0), degree, 2.5 * np.pi / omega)) < 0.02


@pytest.mark.parametrize("degree", LEGENDRE)
def test_plate_frequency_grows_with_the_square_of_the_wave_number(degree: int, backend: str) -> None:
    modulus, thickness, density, poisson = 2e5, 0.05, 800.0, 0.25
    rigidity = modulus * thickness**3 / 12 / (1 - poisson**2)
    omega = np.sqrt(rigidity / (density * thickness)) * degree * (degree + 1)
    material = Material.plate(modulus=modulus, thickness=thickness, density=density, poisson=poisson)
    time = 2.25 * np.pi / omega
    assert amplitude(material, degree, time, backend, n=48 if backend == "cpu" else 32) == pytest.approx(
        np.cos(omega * time), abs=0.05
    )


def test_plate_frequencies_converge_at_second_order() -> None:
    # a quarter of a period before the mode's zero the amplitude is steepest: it shows the error of the frequency
    omega = np.sqrt(0.03) * 20
    errors = [abs(amplitude(Material(speed=0, bending=0.03), 4, 2.5 * np.pi / omega, n=n)) for n in (16, 32, 64)]
    assert np.log2(errors[0] / errors[1]) > 1.8
    assert np.log2(errors[1] / errors[2]) > 1.8


def test_tension_and_bending_add_up_in_the_dispersion_relation(backend: str) -> None:
    omega = np.sqrt(0.7**2 * 20 + 0.02 * 20**2 + 3.0)
    material = Material(speed=0.7, bending=0.02, stiffness=3.0)
    assert amplitude(material, 4, 1.3, backend) == pytest.approx(np.cos(omega * 1.3), abs=0.02)


def test_plate_conserves_energy_and_its_step_is_stable_and_close_to_the_limit(animal: Atlas) -> None:
    waves = WaveSolver(animal, Material.plate(thickness=0.002), backend="cpu")
    waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
    waves.step(5 * waves.stable_timestep)
    energy = waves.energy()
    waves.step(4000 * waves.stable_timestep)
    assert waves.energy() == pytest.approx(energy, rel=1e-4)
    waves._backend.advance(2000, 1.06 * waves.stable_timestep)
    assert not np.abs(waves._backend.height()).max() < 1e3


@pytest.mark.parametrize("degree", [2, 4])
def test_stiffness_and_both_dampings_are_those_of_theory(degree: int, backend: str) -> None:
    speed, nu, across = 0.85, 0.0055, 9.9
    square = degree * (degree + 1) + across
    omega0, rate = speed * np.sqrt(square), nu * square / 2
    material = Material(speed=speed, stiffness=speed**2 * across, viscosity=nu, damping=nu * across)
    for time in (0.4, 1.7):
        value = amplitude(material, degree, time, backend, n=24)
        assert value == pytest.approx(decaying(omega0, rate, time), abs=0.015)
    if backend == "cpu":
        assert abs(amplitude(material, degree, 200.0, n=16)) < 0.02


def test_dent_leaves_what_energy_beyond_the_yield_height_pays_for(backend: str) -> None:
    k, limit, v = 400.0, 0.01, 1.0
    waves = WaveSolver(
        sphere_atlas(1.0, 4),
        Material.dent(limit, stiffness=k, speed=1.0, damping=0.0),
        backend=backend,
        conserve_volume=False,
    )
    waves.velocity = np.full((6, 4, 4), -v)
    for _ in range(1000):
        waves.step(0.001)
    # v^2 / 2 = k limit^2 / 2 + k limit dent
    dent = (v**2 / k - limit**2) / (2 * limit)
    np.testing.assert_allclose(waves.dent, -dent, rtol=0.01)
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
    waves = WaveSolver(animal, Material.dent(0.002, stiffness=100.0, speed=0.2, damping=8.0), backend="cpu")
    waves.add_impulse(animal.mesh.V[100], 0.02, 0.06)
    waves.step(4.0)
    dent = waves.dent
    assert dent.min() < -0.001
    np.testing.assert_allclose(waves.height, dent, atol=1e-4)
    waves.add_height(np.zeros_like(dent))
    np.testing.assert_array_equal(waves.dent, dent)
    waves.reset()
    assert not waves.dent.any()


def maps(atlas: Atlas) -> Material:
    """Every coefficient a map."""
    rng, shape, z = np.random.default_rng(8), atlas.areas.shape, atlas.positions[..., 2]
    return Material(
        speed=rng.uniform(0, 0.6, shape) * (z < 0.1),
        damping=rng.uniform(0, 1, shape),
        stiffness=rng.uniform(0, 5, shape),
        viscosity=rng.uniform(0, 1e-3, shape),
        density=rng.uniform(1, 2, shape),
        bending=rng.uniform(0, 1e-6, shape) * (z < 0.1),
        yield_height=rng.uniform(1e-3, 1e-2, shape),
        fixed=atlas.positions[..., 0] > 0.2,
    )


MODELS = {
    "membrane": lambda _: Material.membrane(0.2, 2.0, damping=0.5),
    "jelly": lambda _: Material.jelly(modulus=100.0, thickness=0.05, viscosity=0.1),
    "plate": lambda _: Material.plate(modulus=1e4, thickness=0.002, damping=0.3),
    "dent": lambda _: Material.dent(0.002, stiffness=50.0, speed=0.3),
    "maps": maps,
}


@pytest.mark.parametrize("model", MODELS)
def test_gl_equals_cpu_for_every_model(animal: Atlas, gl_backend: str, model: str) -> None:
    def run(name: str) -> np.ndarray:
        waves = WaveSolver(animal, MODELS[model](animal), backend=name)
        waves.add_impulse(animal.mesh.V[100], 0.2, 0.06)
        waves.add_force(animal.mesh.V[900], 0.5, 0.1)
        waves._backend.advance(10, waves.stable_timestep)
        waves.step(200 * waves.stable_timestep)
        return waves.height

    reference = run("cpu")
    assert np.abs(reference).max() > 0
    assert np.abs(run(gl_backend) - reference).max() <= 1e-5 * np.abs(reference).max()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Material.plate(modulus=-1.0), "modulus is -1.0 Pa"),
        (lambda: Material.plate(poisson=0.7), "poisson is 0.7"),
        (lambda: Material.jelly(thickness=0.0), "thickness is 0.0 m"),
        (lambda: Material.membrane(tension=np.inf), "tension is inf N/m"),
        (lambda: Material.dent(0.0), "yield_height is 0 m"),
        (lambda: Material(fixed=np.zeros((6, 4, 4))), "fixed has type float64"),
        (lambda: Material(bending=np.inf), "bending is inf"),
        (lambda: Material(speed=-1.0), "speed is -1 m/s"),
        (lambda: Material(density=0.0), "greater than 0"),
        (lambda: Material(damping=np.nan), "damping is nan"),
        (lambda: Material(viscosity=np.zeros((6, 4, 5))), "shape"),
    ],
)
def test_bad_materials_are_named(make, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        make()


def test_coefficients_per_texel_equal_the_same_numbers(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    numbers = {"speed": 0.7, "damping": 0.5, "stiffness": 2.0, "viscosity": 0.01, "density": 3.0}
    rng = np.random.default_rng(0)
    start = rng.standard_normal((6, 16, 16))
    results = []
    for fields in (numbers, {key: np.full((6, 16, 16), value) for key, value in numbers.items()}):
        waves = WaveSolver(atlas, Material(**fields), backend=backend)
        waves.height = start
        waves.step(0.5)
        results.append(waves.height)
    np.testing.assert_allclose(results[0], results[1], atol=1e-6)
