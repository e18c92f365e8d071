"""The footprint: exact total, true distances along the surface, no leak through thin parts.

The weights of a footprint: straight where the surface is flat, along it where it is not.
"""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Atlas, Mesh, WaveSolver, build_atlas, sphere_atlas
from ripple_sim.solver.texels.distance import distance_from_point
from ripple_sim.solver.waves.footprint import footprint, footprint_at


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


def test_footprint_measures_straight_where_it_is_flat_and_along_the_surface_where_it_is_not(animal: Atlas) -> None:
    """Both ways through the code against distances by fast marching."""
    rng = np.random.default_rng(1)
    positions, flat = animal.positions.reshape(-1, 3), 0
    for vertex in rng.integers(0, len(animal.mesh.V), 40):
        (point,), (center,) = animal.nearest(animal.mesh.V[vertex])
        where = footprint_at(animal, point, int(center), 0.08)
        texels, along = distance_from_point(animal.texels, int(center), point, 3 * where.radius)
        distance = dict(zip(texels.tolist(), along, strict=True))
        height = (where.weights / where.weights.max()) ** (1 / 3)
        used = where.radius * np.sqrt(1 - np.minimum(1, height * (1 - (min(distance.values()) / where.radius) ** 2)))
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
