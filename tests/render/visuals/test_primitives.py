"""Tessellated primitives against their areas."""

import numpy as np
import pytest

from ripple_sim.render.visuals import shapes


def ellipsoid_area(a: float, b: float, c: float) -> float:
    theta, phi = np.meshgrid((np.arange(400) + 0.5) * np.pi / 400, (np.arange(400) + 0.5) * np.pi / 200)
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    stretch = np.sqrt((b * c * x) ** 2 + (a * c * y) ** 2 + (a * b * z) ** 2)
    return float((stretch * np.sin(theta)).sum() * np.pi / 400 * np.pi / 200)


@pytest.mark.parametrize(
    ("shape", "core", "shell", "area"),
    [
        (shapes.ball(14), [0, 0, 0], [0.5, 0.5, 0.5], np.pi),
        (shapes.ball(14), [0, 0, 0], [0.5, 0.3, 0.2], ellipsoid_area(0.5, 0.3, 0.2)),
        (shapes.capsule(40, 9), [0, 0, 0.4], [0.3, 0.3, 0.3], 4 * np.pi * 0.09 + 2 * np.pi * 0.3 * 0.8),
        (shapes.cylinder(56, 3), [0.299, 0.299, 0.399], [0.001] * 3, 2 * np.pi * 0.09 + 2 * np.pi * 0.3 * 0.8),
        (shapes.box(3), [0.199, 0.299, 0.399], [0.001] * 3, 8 * (0.2 * 0.3 + 0.3 * 0.4 + 0.4 * 0.2)),
    ],
    ids=["sphere", "ellipsoid", "capsule", "cylinder", "box"],
)
def test_primitives_are_closed_face_outwards_and_have_their_area(shape, core, shell, area):
    V, F = shape.positions(np.array(core), np.array(shell)), shape.faces
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    directed, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 1
    np.testing.assert_array_equal(directed, np.unique(edges[:, ::-1], axis=0))
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    centre = V[F].mean(axis=1)
    assert np.einsum("ij,ij->i", cross, centre).min() > -1e-15
    # the vertices' own normals lean to the outside of their triangles
    normals = shape.normals / np.array(shell)
    assert np.einsum("ij,ij->i", cross, normals[F].sum(axis=1)).min() > -1e-15
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(area, rel=0.01)
