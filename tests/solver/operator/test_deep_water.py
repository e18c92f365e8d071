"""Deep water: the root against a dense one, speed, energy, decay, pushes, refusals."""

import copy

import numpy as np
import pytest
from hand_made import flat_torus
from modes import swing
from scipy.linalg import eigh

from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.operator import HalfLaplacian, frequency
from ripple_sim.solver.texels import stiffness_matrix


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return sphere_atlas(0.3, 10)


@pytest.fixture(scope="module")
def root(atlas: Atlas) -> HalfLaplacian:
    return HalfLaplacian(atlas.texels.stencil(np.ones_like(atlas.areas)), atlas.areas)


def test_the_operator_is_the_dense_root_within_a_thousandth(
    atlas: Atlas, root: HalfLaplacian
) -> None:
    matrix = stiffness_matrix(atlas.texels.stencil(np.ones_like(atlas.areas))).toarray()
    squares, modes = eigh(matrix, np.diag(atlas.areas.ravel()))
    for k in (1, 5, 40, 300, len(squares) - 1):
        mode = modes[:, k].reshape(atlas.areas.shape)
        error = root(mode) - np.sqrt(squares[k]) * mode
        assert np.abs(error).max() < 1e-3 * np.sqrt(squares[k]) * np.abs(mode).max()
    assert root.most == pytest.approx(np.sqrt(squares[-1]), rel=0.01)


def test_the_operator_is_symmetric_and_0_on_constants(atlas: Atlas, root: HalfLaplacian) -> None:
    a, b = np.random.default_rng(0).normal(size=(2, *atlas.areas.shape))
    forth = (atlas.areas * a * root(b)).sum()
    back = (atlas.areas * b * root(a)).sum()
    assert forth == pytest.approx(back, rel=1e-10)
    assert (atlas.areas * a * root(a)).sum() > 0
    assert np.abs(root(np.ones_like(a))).max() < 1e-9 * root.most
    assert abs((atlas.areas * root(a)).sum()) < 1e-9


def test_inverse_and_operator_cancel(atlas: Atlas, root: HalfLaplacian) -> None:
    field = np.random.default_rng(1).normal(size=atlas.areas.shape)
    field -= (atlas.areas * field).sum() / atlas.areas.sum()
    np.testing.assert_allclose(root(root.inverse(field)), field, atol=1e-7)
    np.testing.assert_allclose(root.inverse(root(field)), field, atol=1e-7)


def test_waves_of_a_sphere_are_of_its_harmonics(atlas: Atlas, root: HalfLaplacian) -> None:
    x, _, z = np.moveaxis(atlas.positions / 0.3, -1, 0)
    for degree, harmonic in ((1, z), (2, x * z), (3, z * (5 * z * z - 3))):
        share = (root(harmonic) * harmonic).sum() / (harmonic**2).sum()
        assert share == pytest.approx(np.sqrt(degree * (degree + 1)) / 0.3, rel=0.02)


DENSITY = 1000.0
GRAVITY = 9.81


@pytest.fixture(scope="module")
def torus() -> Atlas:
    return texel_atlas(flat_torus(24))


def water(q: float, ratio: float, viscosity: float = 0.0) -> Material:
    """Liquid in which a wave number is a multiple of the crossover's."""
    return Material.water(DENSITY, DENSITY * GRAVITY / (q / ratio) ** 2, GRAVITY, viscosity)


def swung(atlas: Atlas, material: Material, q: float) -> tuple[float, float]:
    waves = WaveSolver(atlas, material, backend="cpu")
    return swing(
        waves, np.cos(q * atlas.positions[..., 0]), 2 * np.pi / frequency(material, q) / 40, 60
    )


@pytest.mark.parametrize("ratio", [0.3, 1.0, 3.0, 30.0])
def test_waves_run_as_gravity_and_tension_want_them_to(torus: Atlas, ratio: float) -> None:
    q = 4 * np.pi  # 12 texels
    assert frequency(water(q, ratio), q) ** 2 == pytest.approx(GRAVITY * q * (1 + ratio**2))
    measured, _ = swung(torus, water(q, ratio), q)
    assert measured == pytest.approx(frequency(water(q, ratio), q), rel=0.02)


def test_waves_die_as_the_viscosity_wants_them_to(torus: Atlas) -> None:
    q = 4 * np.pi
    viscosity = 2e-3
    _, rate = swung(torus, water(q, 1.0, viscosity), q)
    assert rate == pytest.approx(2 * viscosity * q**2, rel=0.03)


def test_energy_and_volume_stay_and_a_copy_continues_like_the_original(torus: Atlas) -> None:
    waves = WaveSolver(torus, water(10.0, 1.0), backend="cpu", conserve_volume=False)
    waves.add_impulse([0.3, 0.4, 0.0], 5.0, 0.12)
    waves.step(waves.stable_timestep)
    energy = waves.energy()
    assert energy > 0
    other = copy.copy(waves)
    for each in (waves, other):
        each.step(200 * waves.stable_timestep)
        assert each.energy() == pytest.approx(energy, rel=1e-5)
        assert abs(each.volume()) < 1e-6 * np.abs(each.height).max()
    np.testing.assert_array_equal(waves.height, other.height)
    with pytest.raises(SolverError, match="are longer than the stable"):
        waves.step(3 * waves.stable_timestep, substeps=1)


def test_a_push_gives_the_energy_that_theory_says(torus: Atlas) -> None:
    """An impulse J cos(q x) per area makes v = -(q / rho) J cos(q x).

    The kinetic energy is J^2 q A / (4 rho).
    """
    q = 4 * np.pi
    impulse = 3.0
    waves = WaveSolver(torus, water(q, 1.0), backend="cpu")
    wave = np.cos(q * torus.positions[..., 0])
    dt = 1e-6
    waves.pressure = impulse * wave / dt
    waves.step(dt)
    expected = -q / DENSITY * impulse * wave
    assert np.abs(waves.velocity - expected).max() < 0.02 * np.abs(expected).max()
    assert waves.energy() == pytest.approx(impulse**2 * q / (4 * DENSITY), rel=0.02)


def test_held_parts_stay_and_reflect(torus: Atlas) -> None:
    fixed = torus.positions[..., 0] < 0.2
    material = Material.water(DENSITY, 10.0)
    waves = WaveSolver(torus, Material(**{**vars(material), "fixed": fixed}), backend="gl")
    assert waves.backend == "cpu"  # although backend "gl" is asked for
    waves.add_impulse([0.6, 0.5, 0.0], 1.0, 0.1)
    waves.step(0.1)
    assert not waves.height[fixed].any()
    assert np.abs(waves.height[~fixed]).max() > 0


@pytest.mark.parametrize(
    ("coefficients", "message"),
    [
        ({"bending": 1.0}, "got bending"),
        ({"yield_height": 0.1}, "got a yield height"),
        ({"density": np.linspace(1, 2, 384).reshape(6, 8, 8)}, "a density that varies"),
        ({"deep": np.ones((6, 8, 8))}, "must be one number"),
        ({"deep": -1.0}, "material deep must be .*, got -1 1/m"),
    ],
    ids=["bending", "yield", "density", "map", "negative"],
)
def test_materials_that_a_fluid_does_not_support_are_refused(
    coefficients: dict, message: str
) -> None:
    with pytest.raises(SolverError, match=message):
        WaveSolver(
            sphere_atlas(1.0, 8),
            Material(**{**vars(Material.water()), **coefficients}),
            backend="cpu",
        )
    with pytest.raises(SolverError, match=r"gravity must be .*, got 0"):
        Material.water(gravity=0.0)
