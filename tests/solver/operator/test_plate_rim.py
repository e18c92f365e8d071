"""Rims of plates: published frequencies, no negative energy, and the same numbers from both backends."""

import numpy as np
import pytest
import surfaces
from hand_made import disk, polygon, square
from scipy.linalg import eigvalsh
from scipy.sparse import diags_array

from ripple_sim.solver import Material, SolverError, WaveSolver, build_atlas, texel_atlas
from ripple_sim.solver.operator import build_operator
from ripple_sim.solver.operator.modes import elastic_matrix, modes

PLATE = Material(speed=0.0, bending=1.0, poisson=0.3)


def on_one_side(points: np.ndarray) -> np.ndarray:
    """A cantilever."""
    return points[:, 0] < 1e-6


# Angular frequencies over sqrt(b) / side^2. Supported: pi^2 (m^2 + n^2). The others to four digits: free and cantilever
# after Leissa (1973), whose values are upper bounds, and clamped ones after Birger.
TABLES = {
    "supported": ("supported", np.pi**2 * np.array([2, 5, 5, 8, 10, 10])),
    "free": ("free", [13.468, 19.596, 24.270, 34.801, 34.801, 61.09]),
    "clamped": ("clamped", [35.99, 73.41, 73.41, 108.3, 131.6, 132.2]),
    "cantilever": (on_one_side, [3.4711, 8.5067, 21.285, 27.199, 30.955, 54.187]),
}


@pytest.fixture(scope="module")
def sheet():
    """Unit square on patches, with irregular vertices inside."""
    return build_atlas(surfaces.square(8), 32, layout="patches")


@pytest.mark.parametrize("name", TABLES)
def test_a_square_plate_has_the_frequencies_of_the_tables(name: str, sheet) -> None:
    rim, expected = TABLES[name]
    found = 2 * np.pi * modes(sheet, PLATE, len(expected), rim=rim).frequencies
    np.testing.assert_allclose(found, expected, rtol=0.01)


@pytest.mark.parametrize(("rim", "expected"), [("supported", 4.935), ("clamped", 10.216), ("free", 5.358)])
def test_a_round_plate_has_them_too(rim: str, expected: float) -> None:
    found = 2 * np.pi * modes(texel_atlas(disk(20)), PLATE, 1, rim=rim).frequencies
    assert found[0] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("rim", ["free", "supported", "clamped", on_one_side])
@pytest.mark.parametrize("poisson", [0.0, 0.5])
@pytest.mark.parametrize("texels", [square(10), disk(6), polygon(6, 6)], ids=["square", "disk", "hexagon"])
def test_no_shape_has_negative_energy_even_where_the_thickness_varies(texels, poisson: float, rim) -> None:
    bending = 1 + 5 * (texels.positions[..., 0] > 0.3)
    material = Material(speed=0.0, bending=bending, poisson=poisson)
    operator = build_operator(texel_atlas(texels), material, "fem", rim)
    root = diags_array(1 / np.sqrt(operator.mass.ravel()))
    rates = eigvalsh((root @ elastic_matrix(operator) @ root).toarray())
    assert rates[0] > -1e-7 * rates[-1]
    assert 2 / np.sqrt(rates[-1]) == pytest.approx(operator.stable_timestep, rel=0.02)


def test_energy_is_kept_and_both_backends_agree(sheet, opengl: None) -> None:
    heights = []
    for backend in ("cpu", "gl"):
        waves = WaveSolver(sheet, PLATE, backend=backend, rim=on_one_side, conserve_volume=False)
        waves.height = np.exp(-np.sum((sheet.positions - [0.9, 0.9, 0.0]) ** 2, axis=-1) / 0.02)
        waves.step(waves.stable_timestep, 1)
        before = waves.energy()
        waves.step(1e-2)
        assert waves.energy() == pytest.approx(before, rel=1e-3)
        heights.append(waves.height)
    assert np.abs(heights[0] - heights[1]).max() < 1e-4 * np.abs(heights[0]).max()


def test_a_free_plate_keeps_its_momentum(sheet) -> None:
    waves = WaveSolver(sheet, PLATE, backend="cpu", conserve_volume=False)
    waves.add_impulse([0.1, 0.2, 0.0], 1.0, 0.1)
    waves.step(1e-2)
    assert waves.momentum() == pytest.approx(-1.0, rel=1e-4)


def test_a_membrane_is_held_where_the_function_says_so(sheet) -> None:
    # as the rim of a drum on two sides: sin in between, even along them
    def rim(points: np.ndarray) -> list[str]:
        return ["supported" if x < 1e-6 or x > 1 - 1e-6 else "free" for x in points[:, 0]]

    found = modes(sheet, Material(speed=1.0), 4, rim=rim).frequencies
    np.testing.assert_allclose(2 * found, [1, np.sqrt(2), 2, np.sqrt(5)], rtol=0.01)


def test_a_plate_that_is_turned_rings_as_before(sheet) -> None:
    plain, turned = (WaveSolver(sheet, PLATE, backend="cpu", conserve_volume=False) for _ in range(2))
    # a motion with stretch, and back: the operator is made anew twice
    for factor in (1.1, 1.0):
        turned.move(factor * sheet.mesh.V)
    for waves in (plain, turned):
        waves.add_impulse([0.1, 0.2, 0.0], 1.0, 0.1)
        waves.step(1e-3)
    assert np.abs(plain.height - turned.height).max() < 1e-3 * np.abs(plain.height).max()


@pytest.mark.parametrize("wrong", ["bent", 3, lambda points: "free", lambda points: ["bent"] * len(points)])
def test_what_is_no_rim_is_refused(wrong, sheet) -> None:
    with pytest.raises(SolverError, match=r"valid are .*'free', 'supported'"):
        WaveSolver(sheet, PLATE, backend="cpu", rim=wrong)
