"""PLY files: text and binary, mixed polygons, texture coordinates."""

from __future__ import annotations

from pathlib import Path

import pytest
from mesh_text import CORNERS, L_SHAPE, QUADS, ply, prism, written

from ripple_sim.solver import load_mesh


@pytest.mark.parametrize("layout", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("length", ["uchar", "int"])
def test_ply_files_of_every_layout_with_mixed_polygons(tmp_path: Path, layout: str, kind: str, length: str) -> None:
    content = ply(*prism(L_SHAPE), layout, kind=kind, length=length)
    mesh = load_mesh(written(tmp_path, "prism.ply", content))
    assert (len(mesh.V), len(mesh.F)) == (12, 20)
    assert mesh.volume == pytest.approx(3)
    assert load_mesh(written(tmp_path, "quads.ply", ply(CORNERS, QUADS, layout, kind=kind))).volume == pytest.approx(1)


@pytest.mark.parametrize("layout", ["ascii", "binary_little_endian"])
def test_texture_coordinates_of_the_corners_of_a_ply_file(tmp_path: Path, layout: str) -> None:
    mesh = load_mesh(written(tmp_path, "box.ply", ply(CORNERS, QUADS, layout, texcoord=True)))
    assert mesh.corner_uv is not None
    for triangle, pairs in zip(mesh.F, mesh.corner_uv, strict=True):
        quad = QUADS[int(pairs[0, 0])]
        assert [quad[int(j)] for j in pairs[:, 1]] == [CORNERS.index(tuple(mesh.V[vertex])) for vertex in triangle]
