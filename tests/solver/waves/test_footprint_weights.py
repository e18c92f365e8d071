"""The weights of a footprint: straight where the surface is flat, along it where it is not."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.texels.distance import distance_from_point
from ripple_sim.solver.waves.footprint import footprint, footprint_at


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
