"""Shipped meshes with handles and rims."""

import igl
import numpy as np
import pytest

from ripple_sim.scenes import vessels
from ripple_sim.scenes.shapes import polygonise, sphere
from ripple_sim.solver import load_mesh


@pytest.mark.parametrize(
    ("path", "genus", "rims"), [(vessels.TEAPOT_FILE, [1, 0], 3), (vessels.PRETZEL_FILE, [3], 0)], ids=str
)
def test_shipped_meshes_have_their_handles_and_rims_and_no_slivers(path, genus, rims):
    mesh = load_mesh(path)
    assert not mesh.notes
    assert mesh.genus.tolist() == genus
    assert len(mesh.rims) == rims
    assert np.degrees(igl.internal_angles(mesh.V, mesh.F)).min() > 10
    assert mesh.V[:, 2].min() == pytest.approx(0, abs=1e-4)


def test_a_ball_cut_open_ends_at_the_plane():
    ball = sphere((0.0, 0.0, 0.0), 0.5)
    V, F = vessels.opened(ball, *polygonise(ball, ((-0.6,) * 3, (0.6,) * 3), 0.05), (0.0, 0.0, 0.2), (0, 0, 1), 0.05)
    rim = np.unique(igl.boundary_facets(F)[0])
    np.testing.assert_allclose(V[rim, 2], 0.2, atol=2e-4)
    np.testing.assert_allclose(np.linalg.norm(V, axis=1), 0.5, atol=2e-3)
    assert V[:, 2].max() < 0.2 + 2e-4
    assert igl.euler_characteristic(F) == 1
    # Archimedes: a cap's area goes with its height
    assert igl.doublearea(V, F).sum() / 2 == pytest.approx(2 * np.pi * 0.5 * 0.7, rel=0.01)
    assert np.degrees(igl.internal_angles(V, F)).min() > 8
