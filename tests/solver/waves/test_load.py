"""Loads over a step, held forces and pressure: sums and ends; a source's footprint."""

import numpy as np
import pytest
import trimesh
from arrival import distance_from_point

from ripple_sim.solver import (
    Atlas,
    Load,
    Material,
    Mesh,
    SolverError,
    WaveSolver,
    build_atlas,
    sphere_atlas,
)
from ripple_sim.solver.waves import footprint_at
from ripple_sim.solver.waves.footprint import footprint


def test_a_load_acts_over_its_step_beside_held_forces(backend: str) -> None:
    waves = WaveSolver(
        sphere_atlas(1.0, 16), Material(density=2.0), backend=backend, conserve_volume=False
    )
    waves.add_force([0, 0, 1], 3.0, 0.3)
    waves.step(0.1, load=Load(np.array([5, 9, 5]), np.array([1.0, 0.5, 2.0])))
    assert waves.momentum() == pytest.approx(-0.65, rel=1e-5)
    waves.step(0.1)
    assert waves.momentum() == pytest.approx(-0.95, rel=1e-5)
    assert (waves.pressure * waves.atlas.areas).sum() == pytest.approx(3.0)


def test_load_is_the_same_as_a_held_force_that_is_ended(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    results = []
    where = footprint(atlas, [1, 0, 0], 0.4)
    shares = where.weights * atlas.areas.reshape(-1)[where.texels]
    for held in (True, False):
        waves = WaveSolver(atlas, Material(speed=0.5), backend=backend)
        if held:
            waves.add_force([1, 0, 0], 2.0, 0.4)
            waves.step(0.2)
            waves.pressure = 0
        else:
            waves.step(0.2, load=Load(where.texels, 2.0 * shares))
        waves.step(0.2)
        results.append(waves.height)
    np.testing.assert_allclose(results[0], results[1], atol=1e-6 * np.abs(results[0]).max())


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (
            Load(np.array([3, 384]), np.ones(2)),
            "must be indices from 0 to 383, got 3 to 384",
        ),
        (Load(np.array([-1]), np.ones(1)), "got -1 to -1"),
        (Load(np.array([1]), np.array([np.nan])), "add up to nan N"),
    ],
)
def test_loads_that_cannot_be_are_refused(load: Load, message: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=message):
        waves.step(0.1, load=load)


@pytest.mark.parametrize("conserve", [True, False])
def test_held_force_changes_momentum_by_force_times_time(
    animal: Atlas, backend: str, conserve: bool
) -> None:
    waves = WaveSolver(
        animal, Material(speed=0.3, density=2.0), backend=backend, conserve_volume=conserve
    )
    waves.add_force(animal.mesh.V[100], 3.0, 0.06)
    waves.add_force(animal.mesh.V[105], 1.0, 0.06)
    waves.step(0.11)
    waves.step(0.07)
    expected = 0.0 if conserve else -4.0 * 0.18
    assert waves.momentum() == pytest.approx(expected, rel=1e-4, abs=1e-5)
    assert (waves.pressure * animal.areas).sum() == pytest.approx(4.0)
    waves.pressure = 0
    before = waves.momentum()
    waves.step(0.1)
    assert waves.momentum() == pytest.approx(before, rel=1e-4, abs=1e-5)


def test_static_deflection_under_pressure_is_pressure_over_spring(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    material = Material(speed=0.5, stiffness=40.0, damping=12.0, density=5.0)
    waves = WaveSolver(atlas, material, backend=backend, conserve_volume=False)
    y20 = (3 * atlas.positions[..., 2] ** 2 - 1) / 2
    waves.pressure = 7.0 + 2.0 * y20
    waves.step(6.0)
    expected = -7.0 / (5.0 * 40.0) - 2.0 * y20 / (5.0 * (40.0 + 0.25 * 6))
    np.testing.assert_allclose(waves.height, expected, atol=2e-3 * 7 / 200)


def test_force_held_over_a_step_equals_many_small_impulses(animal: Atlas) -> None:
    point = animal.mesh.V[700]
    force = 2.0  # [N]
    radius = 0.08  # [m]
    duration = 0.4  # [s]
    held = WaveSolver(animal, Material(speed=0.4), backend="cpu")
    held.add_force(point, force, radius)
    held.step(duration)
    pushed = WaveSolver(animal, Material(speed=0.4), backend="cpu")
    pieces = 400
    for _ in range(pieces):
        pushed.add_impulse(point, force * duration / pieces, radius)
        pushed.step(duration / pieces)
    # an impulse acts at the beginning of its piece: an error of the order of a piece
    difference = np.abs(held.height - pushed.height).max()
    assert difference < 0.01 * np.abs(held.height).max()


def test_weights_integrate_to_one(animal: Atlas) -> None:
    rng = np.random.default_rng(2)
    for vertex, radius in zip(
        rng.integers(0, len(animal.mesh.V), 20), rng.uniform(0, 0.2, 20), strict=True
    ):
        where = footprint(animal, animal.mesh.V[vertex], radius)
        total = (where.weights * animal.areas.reshape(-1)[where.texels]).sum()
        assert total == pytest.approx(1, rel=1e-12)
        assert len(np.unique(where.texels)) == len(where.texels)


def test_centroid_of_the_footprint_is_the_source() -> None:
    atlas = sphere_atlas(1.0, 64)
    rng = np.random.default_rng(0)
    for point in rng.standard_normal((20, 3)):
        point /= np.linalg.norm(point)
        where = footprint(atlas, point, 0.12)
        share = where.weights * atlas.areas.reshape(-1)[where.texels]
        centroid = share @ atlas.positions.reshape(-1, 3)[where.texels]
        centroid /= np.linalg.norm(centroid)
        texel = np.pi / 2 / 64
        assert np.linalg.norm(centroid - point) < 0.1 * texel


def test_footprint_measures_straight_where_it_is_flat_and_along_the_surface_where_it_is_not(
    animal: Atlas,
) -> None:
    """Both ways through the code against distances by fast marching."""
    rng = np.random.default_rng(1)
    positions = animal.positions.reshape(-1, 3)
    flat = 0
    for vertex in rng.integers(0, len(animal.mesh.V), 40):
        (point,), (center,) = animal.nearest(animal.mesh.V[vertex])
        where = footprint_at(animal, point, int(center), 0.08)
        texels, along = distance_from_point(animal.texels, int(center), point, 3 * where.radius)
        distance = dict(zip(texels.tolist(), along, strict=True))
        height = (where.weights / where.weights.max()) ** (1 / 3)
        used = where.radius * np.sqrt(
            1 - np.minimum(1, height * (1 - (min(distance.values()) / where.radius) ** 2))
        )
        straight = np.linalg.norm(positions[where.texels] - point, axis=1)
        true = np.array([distance[texel] for texel in where.texels.tolist()])
        assert (used > 0.97 * straight - 0.05 * where.radius).all()
        assert (used < 1.05 * true + 0.05 * where.radius).all()
        flat += np.allclose(used, straight, atol=0.02 * where.radius)
    assert 5 < flat < 40, "only one of the two ways was taken"


def test_small_radius_is_raised_to_two_texels() -> None:
    atlas = sphere_atlas(1.0, 32)
    where = footprint(atlas, [0, 0, 1], 0.0)
    assert where.radius == pytest.approx(2 * np.pi / 2 / 32, rel=0.05)
    assert len(where.texels) >= 9


@pytest.fixture(scope="module")
def plate() -> Atlas:
    box = trimesh.creation.box(extents=(1.0, 1.0, 0.02))
    V, F = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=0.06)
    return build_atlas(Mesh.from_arrays(V, F), 64, cache=False)


def test_impulse_does_not_leak_through_a_thin_plate(plate: Atlas) -> None:
    where = footprint(plate, [0.1, -0.1, 0.01], 0.2)
    hit = plate.positions.reshape(-1, 3)[where.texels]
    assert (hit[:, 2] > 0.0099).all()
    # all of the disc is there: as many texels as its area holds
    assert plate.areas.reshape(-1)[where.texels].sum() == pytest.approx(np.pi * 0.2**2, rel=0.1)


def test_distance_along_a_folded_surface_goes_round_the_edge(plate: Atlas) -> None:
    # 0.1 from the rim: the way to the same place below is 0.1 + 0.02 + 0.1
    where = footprint(plate, [0.4, 0.0, 0.01], 0.2)
    hit = plate.positions.reshape(-1, 3)[where.texels]
    below = hit[hit[:, 2] < -0.005]
    assert len(below) > 0
    assert below[:, 0].min() > 0.4 - 0.02
