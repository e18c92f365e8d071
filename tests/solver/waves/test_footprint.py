"""The footprint: exact total, true distances along the surface, no leak through thin parts."""

import numpy as np
import pytest

from ripple_sim.solver import Atlas, WaveSolver, sphere_atlas
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
