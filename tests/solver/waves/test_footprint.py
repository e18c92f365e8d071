"""The footprint: exact total, true distances along the surface, no leak through thin parts."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Atlas, Mesh, WaveSolver, build_atlas, sphere_atlas
from ripple_sim.solver.waves.footprint import footprint


def test_weights_integrate_to_one(animal: Atlas) -> None:
    rng = np.random.default_rng(2)
    for vertex, radius in zip(rng.integers(0, len(animal.mesh.V), 20), rng.uniform(0, 0.2, 20), strict=True):
        where = footprint(animal, animal.mesh.V[vertex], radius)
        total = (where.weights * animal.areas.reshape(-1)[where.texels]).sum()
        assert total == pytest.approx(1, rel=1e-12)
        assert len(np.unique(where.texels)) == len(where.texels)


def test_impulse_sums_to_momentum_exactly(animal: Atlas, backend: str) -> None:
    waves = WaveSolver(animal, backend=backend, conserve_volume=False)
    total = 0.0
    rng = np.random.default_rng(3)
    for vertex in rng.integers(0, len(animal.mesh.V), 10):
        impulse = rng.uniform(0, 2)
        waves.add_impulse(animal.mesh.V[vertex], impulse, 0.05)
        total += impulse
    assert waves.momentum() == pytest.approx(-total, rel=1e-5)


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


def test_small_radius_is_raised_to_two_texels() -> None:
    atlas = sphere_atlas(1.0, 32)
    where = footprint(atlas, [0, 0, 1], 0.0)
    assert where.radius == pytest.approx(2 * np.pi / 2 / 32, rel=0.05)
    assert len(where.texels) >= 9


def test_impulse_does_not_leak_through_a_thin_plate() -> None:
    plate = trimesh.creation.box(extents=(1.0, 1.0, 0.02))
    V, F = trimesh.remesh.subdivide_to_size(plate.vertices, plate.faces, max_edge=0.06)
    atlas = build_atlas(Mesh.from_arrays(V, F), 64, cache=False)
    where = footprint(atlas, [0.1, -0.1, 0.01], 0.2)
    hit = atlas.positions.reshape(-1, 3)[where.texels]
    assert (hit[:, 2] > 0.0099).all()
    # all of the disc is there: as many texels as its area holds
    disc = np.pi * 0.2**2
    assert atlas.areas.reshape(-1)[where.texels].sum() == pytest.approx(disc, rel=0.1)


def test_distance_along_a_folded_surface_goes_round_the_edge() -> None:
    plate = trimesh.creation.box(extents=(1.0, 1.0, 0.02))
    V, F = trimesh.remesh.subdivide_to_size(plate.vertices, plate.faces, max_edge=0.06)
    atlas = build_atlas(Mesh.from_arrays(V, F), 64, cache=False)
    # 0.1 from the rim: the way to the same place below is 0.1 + 0.02 + 0.1
    where = footprint(atlas, [0.4, 0.0, 0.01], 0.2)
    hit = atlas.positions.reshape(-1, 3)[where.texels]
    below = hit[hit[:, 2] < -0.005]
    assert len(below) > 0
    assert below[:, 0].min() > 0.4 - 0.02
