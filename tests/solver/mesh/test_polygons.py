"""Polygons are cut into triangles without folds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mesh_text import CORNERS, L_SHAPE, QUADS, obj, off, prism, written

from ripple_sim.solver import load_mesh
from ripple_sim.solver.mesh.ply import triangulate

HEXAGON = [(np.cos(a), np.sin(a)) for a in np.arange(6) * np.pi / 3]

COMB = [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (4, 1), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]


@pytest.mark.parametrize(("outline", "area"), [(L_SHAPE, 3), (HEXAGON, 1.5 * 3**0.5), (COMB, 13)])
@pytest.mark.parametrize("write", [obj, off])
@pytest.mark.parametrize("turn", range(3))
def test_polygons_are_cut_without_folds(tmp_path: Path, outline, area: float, write, turn: int) -> None:
    vertices, faces = prism(outline[turn:] + outline[:turn])
    vertices = [np.roll(v, turn) for v in vertices]  # each axis is the polygon's normal once
    mesh = load_mesh(written(tmp_path, f"prism.{write.__name__}", write(vertices, faces)))
    perimeter = np.linalg.norm(np.diff([*outline, outline[0]], axis=0), axis=1).sum()
    assert mesh.volume == pytest.approx(area, rel=1e-5)
    assert mesh.area == pytest.approx(2 * area + perimeter, rel=1e-5)  # folded triangles would count twice


def test_triangulation_keeps_the_winding_of_turned_polygons() -> None:
    rng = np.random.default_rng(0)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 20))
    star = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(20)]) * rng.uniform(0.3, 1, (20, 1))
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    turned = star @ rotation.T + 5
    triangles = triangulate(turned, np.array([20]))
    assert sorted(np.unique(triangles)) == list(range(20))
    normals = np.cross(
        turned[triangles[:, 1]] - turned[triangles[:, 0]], turned[triangles[:, 2]] - turned[triangles[:, 0]]
    )
    assert (normals @ rotation[:, 2] > 0).all()
    shoelace = np.cross(star, np.roll(star, -1, axis=0))[:, 2].sum()
    assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(shoelace)


@pytest.mark.parametrize("write", [obj, off])
def test_faces_of_two_corners_are_left_out_and_counted(tmp_path: Path, write) -> None:
    mesh = load_mesh(written(tmp_path, f"box.{write.__name__}", write(CORNERS, [*QUADS, (0, 1), (2, 3)])))
    assert mesh.closed
    assert mesh.notes == ("2 faces with fewer than three corners left out",)
