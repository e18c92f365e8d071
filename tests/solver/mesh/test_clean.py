"""What is mended on the way in: duplicates, leftovers, cracks, winding."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from solids import cube

from ripple_sim.solver import Mesh


def test_triangle_soup_is_merged() -> None:
    V, F = cube()
    mesh = Mesh.from_arrays(V[F].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert any("duplicate" in note for note in mesh.notes)
    assert mesh.volume == pytest.approx(1)


def test_inward_and_mixed_winding_are_turned_outward() -> None:
    V, F = cube()
    assert Mesh.from_arrays(V, F[:, ::-1]).volume == pytest.approx(1)
    mixed = F.copy()
    mixed[[1, 4, 7]] = mixed[[1, 4, 7]][:, ::-1]
    mesh = Mesh.from_arrays(V, mixed)
    assert mesh.volume == pytest.approx(1)
    assert any("3 triangles reversed" in note for note in mesh.notes)


def test_unused_vertices_and_collapsed_triangles_are_dropped() -> None:
    V, F = cube()
    V = np.vstack([[[9.0, 9.0, 9.0]], V])
    F = np.vstack([F + 1, [[1, 1, 2]], F[:1] + 1])
    mesh = Mesh.from_arrays(V, F)
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert len(mesh.notes) == 3


def test_hairline_cracks_are_closed_but_gaps_are_not() -> None:
    box = trimesh.creation.box()
    F = np.array(box.faces)
    apart = np.vstack([box.vertices, np.array(box.vertices) + 3e-8])
    mesh = Mesh.from_arrays(apart, np.vstack([F[:5], F[5:] + 8]))
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert any("cracks closed" in note for note in mesh.notes)
    wide = Mesh.from_arrays(np.vstack([box.vertices, np.array(box.vertices) + 1e-3]), np.vstack([F[:5], F[5:] + 8]))
    assert not wide.closed
    assert wide.component_count == 2
