"""Rims of plates: published frequencies, energy that is never negative, both backends."""

import functools

import numpy as np
import pytest
import surfaces
import trimesh
from hand_made import disk, polygon, square
from scipy.linalg import eigvalsh
from scipy.sparse import diags_array
from scipy.spatial import Delaunay

from ripple_sim.solver import (
    Atlas,
    Material,
    Mesh,
    SolverError,
    WaveSolver,
    build_atlas,
    texel_atlas,
)
from ripple_sim.solver.errors import RippleWarning
from ripple_sim.solver.operator import STEPS, build_operator
from ripple_sim.solver.operator.modes import elastic_matrix, modes

PLATE = Material(speed=0.0, bending=1.0, poisson=0.3)


def on_one_side(points: np.ndarray) -> np.ndarray:
    """A cantilever."""
    return points[:, 0] < 1e-6


# Angular frequencies over sqrt(b) / side^2. Supported: pi^2 (m^2 + n^2). The others to four digits:
# free and cantilever after Leissa (1973), whose values are upper bounds, and clamped ones after
# Birger.
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


@pytest.mark.parametrize(
    ("rim", "expected"), [("supported", 4.935), ("clamped", 10.216), ("free", 5.358)]
)
def test_a_round_plate_has_the_frequencies_of_the_tables(rim: str, expected: float) -> None:
    found = 2 * np.pi * modes(texel_atlas(disk(20)), PLATE, 1, rim=rim).frequencies
    assert found[0] == pytest.approx(expected, rel=0.01)


def random_sheet(wide: float, seed: int) -> Mesh:
    """Delaunay's triangles of 150 random points in a rectangle, whose rims are full of slivers."""
    inside = np.random.default_rng(seed).uniform(size=(150, 2)) * [1, wide]
    points = np.concatenate([inside, [[0, 0], [1, 0], [1, wide], [0, wide]]])
    return Mesh.from_arrays(np.column_stack([points, 0 * points[:, 0]]), Delaunay(points).simplices)


def bent_sheet(along_x: float, along_y: float) -> Mesh:
    """Square of side 2 with curvatures in its middle, of one sign a dome, of two a saddle."""

    def place(a: np.ndarray, b: np.ndarray) -> tuple:
        x = 2 * a - 1
        y = 2 * b - 1
        return x, y, (along_x * x**2 + along_y * y**2) / 2

    return Mesh.from_arrays(*surfaces.grid(10, place))


def catenoid() -> Mesh:
    def place(a: np.ndarray, b: np.ndarray) -> tuple:
        u = 2 * np.pi * a
        v = 2 * b - 1
        return np.cosh(v) * np.cos(u), np.cosh(v) * np.sin(u), v

    return Mesh.from_arrays(*surfaces.grid(16, place, closed=(True, False)))


def helix() -> Mesh:
    def place(a: np.ndarray, b: np.ndarray) -> tuple:
        u = 9 * a
        v = 0.2 + 0.8 * b
        return v * np.cos(u), v * np.sin(u), 0.3 * u

    return Mesh.from_arrays(*surfaces.grid(16, place))


def scan() -> Mesh:
    """Sphere with twelve holes."""
    solid = trimesh.creation.icosphere(3)
    corners = trimesh.creation.icosahedron().vertices
    corners = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    middles = solid.triangles_center / np.linalg.norm(solid.triangles_center, axis=1, keepdims=True)
    return Mesh.from_arrays(solid.vertices, solid.faces[(middles @ corners.T).max(axis=1) < 0.93])


SHEETS = {
    "slivers, wide": lambda: random_sheet(0.5, 0),
    "slivers, square": lambda: random_sheet(1.0, 0),
    "dome": lambda: bent_sheet(-1.0, -1.0),
    "saddle": lambda: bent_sheet(1.0, -1.0),
    "catenoid": catenoid,
    "helix": helix,
    "scan": scan,
}


@functools.cache
def coarse(name: str) -> Atlas:
    return build_atlas(SHEETS[name](), 8, cache=False)


def rates_of(atlas: Atlas, poisson: float, rim) -> np.ndarray:
    """Squared frequencies, in ascending order."""
    operator = build_operator(atlas, Material(speed=0.0, bending=1.0, poisson=poisson), "fem", rim)
    root = diags_array(1 / np.sqrt(operator.mass.ravel()))
    return eigvalsh((root @ elastic_matrix(operator) @ root).toarray())


@pytest.mark.parametrize(
    ("name", "rim", "poisson"),
    [("slivers, square", "free", 0.3), ("saddle", on_one_side, -0.5), ("catenoid", "free", 0.49)],
)
def test_no_squared_frequency_is_negative_on_slivers_and_saddles(
    name: str, rim, poisson: float
) -> None:
    rates = rates_of(coarse(name), poisson, rim)
    assert rates[0] > -1e-13 * rates[-1]


@pytest.mark.parametrize("name", SHEETS)
def test_energy_does_not_grow_in_five_thousand_stable_steps(name: str) -> None:
    atlas = coarse(name)
    waves = WaveSolver(atlas, PLATE, rim="free", backend="cpu")
    waves.velocity = np.random.default_rng(0).normal(size=atlas.areas.shape)
    waves.step(waves.stable_timestep, 1)
    before = waves.energy()
    waves.step(5000 * waves.stable_timestep, 5000)
    assert waves.energy() == pytest.approx(before, rel=1e-4)


@pytest.mark.parametrize("poisson", [-0.5, 0.49])
def test_a_straight_support_does_not_know_poissons_ratio(poisson: float, sheet) -> None:
    expected = TABLES["supported"][1]
    found = modes(
        sheet, Material(speed=0.0, bending=1.0, poisson=poisson), 6, rim="supported"
    ).frequencies
    np.testing.assert_allclose(2 * np.pi * found, expected, rtol=0.01)


def test_a_flat_free_plate_can_be_tilted_without_energy() -> None:
    atlas = coarse("slivers, square")
    operator = build_operator(atlas, PLATE, "fem", "free")
    for height in (np.ones(atlas.areas.shape), atlas.positions[..., 0], atlas.positions[..., 1]):
        bent = np.sum(-operator.elastic_force(height**2) * height**2) + 1.0
        assert abs(np.sum(operator.elastic_force(height) * height)) < 1e-9 * bent


def test_slivers_along_the_rim_keep_the_frequencies() -> None:
    found = modes(coarse("slivers, square"), PLATE, 3, rim="supported").frequencies
    np.testing.assert_allclose(2 * np.pi * found, np.pi**2 * np.array([2, 5, 5]), rtol=0.05)


def test_a_plate_of_too_few_texels_is_warned_of() -> None:
    with pytest.warns(
        RippleWarning, match=r"softer than its material on 100 % of its surface.*finer resolution"
    ):
        build_operator(texel_atlas(square(2)), PLATE, "fem", "free")


@pytest.mark.parametrize("texels", [square(5), polygon(3, 4), polygon(5, 4), polygon(6, 3)])
def test_curvatures_summed_up_by_their_neighbours_are_the_force_of_the_matrix(texels) -> None:
    bending = build_operator(texel_atlas(texels), PLATE, "fem", "free").bending
    height = np.random.default_rng(0).normal(size=texels.shape)
    topology = texels.topology
    n = texels.resolution
    force = np.zeros_like(height)
    for weights, transposed in zip(bending.weights, bending.transposed, strict=True):
        around = topology.with_halo(height)
        curvature = sum(
            weight * (around[:, 1 + r : n + 1 + r, 1 + c : n + 1 + c] - height)
            for weight, (r, c) in zip(weights, STEPS, strict=True)
        )
        around = topology.with_halo(curvature)
        force -= transposed[-1] * curvature
        for weight, (r, c) in zip(transposed[:-1], STEPS, strict=True):
            force -= weight * around[:, 1 + r : n + 1 + r, 1 + c : n + 1 + c]
    np.testing.assert_allclose(force, bending.force(height), atol=1e-9 * np.abs(force).max())
    assert np.abs(force).max() > 0


@pytest.mark.parametrize("rim", ["free", "supported", "clamped", on_one_side])
@pytest.mark.parametrize("poisson", [-0.5, 0.0, 0.5])
@pytest.mark.parametrize(
    "texels", [square(10), disk(6), polygon(6, 6)], ids=["square", "disk", "hexagon"]
)
def test_no_shape_has_negative_energy_even_where_the_thickness_varies(
    texels, poisson: float, rim
) -> None:
    bending = 1 + 5 * (texels.positions[..., 0] > 0.3)
    material = Material(speed=0.0, bending=bending, poisson=poisson)
    operator = build_operator(texel_atlas(texels), material, "fem", rim)
    root = diags_array(1 / np.sqrt(operator.mass.ravel()))
    rates = eigvalsh((root @ elastic_matrix(operator) @ root).toarray())
    assert rates[0] > -1e-13 * rates[-1]
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


def test_a_function_chooses_where_a_membrane_is_held(sheet) -> None:
    # as the rim of a drum on two sides: sin in between, even along them
    def rim(points: np.ndarray) -> list[str]:
        return ["supported" if x < 1e-6 or x > 1 - 1e-6 else "free" for x in points[:, 0]]

    found = modes(sheet, Material(speed=1.0), 4, rim=rim).frequencies
    np.testing.assert_allclose(2 * found, [1, np.sqrt(2), 2, np.sqrt(5)], rtol=0.01)


def test_a_plate_that_is_turned_rings_as_before(sheet) -> None:
    plain, turned = (
        WaveSolver(sheet, PLATE, backend="cpu", conserve_volume=False) for _ in range(2)
    )
    # a motion with stretch, and back: the operator is made anew twice
    for factor in (1.1, 1.0):
        turned.move(factor * sheet.mesh.V)
    for waves in (plain, turned):
        waves.add_impulse([0.1, 0.2, 0.0], 1.0, 0.1)
        waves.step(1e-3)
    assert np.abs(plain.height - turned.height).max() < 1e-3 * np.abs(plain.height).max()


@pytest.mark.parametrize(
    "wrong", ["bent", 3, lambda points: "free", lambda points: ["bent"] * len(points)]
)
def test_invalid_rims_are_refused(wrong, sheet) -> None:
    with pytest.raises(SolverError, match=r"must .*'free', 'supported'"):
        WaveSolver(sheet, PLATE, backend="cpu", rim=wrong)
