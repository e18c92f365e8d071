"""The analytic atlas of a sphere."""

from __future__ import annotations

import numpy as np
import pytest

from ripple_sim.solver import Mesh, sphere_atlas


def test_sphere_atlas_is_exact() -> None:
    atlas = sphere_atlas(2.5, 24)
    np.testing.assert_allclose(np.linalg.norm(atlas.positions, axis=-1), 2.5, rtol=1e-15)
    assert atlas.radius == pytest.approx(2.5)
    mesh = Mesh.from_arrays(atlas.mesh.V, atlas.mesh.F)
    assert mesh.notes == ()
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 2.5**3, rel=0.01)
    points, directions = atlas.project([[0, 0, 9.0], [1, 1, 1]])
    np.testing.assert_allclose(points[0], [0, 0, 2.5])
    np.testing.assert_allclose(directions[1], np.ones(3) / np.sqrt(3))
