"""PLY files: text, binary, lists, texture coordinates, polygons, cut files."""

from pathlib import Path

import numpy as np
import pytest
from mesh_text import CORNERS, L_SHAPE, QUADS, obj, off, ply, prism, written

from ripple_sim.solver import load_mesh
from ripple_sim.solver.errors import MeshError
from ripple_sim.solver.mesh import triangulate

LAYOUTS = ["ascii", "binary_little_endian", "binary_big_endian"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("length", ["uchar", "int"])
def test_ply_files_of_every_layout_with_mixed_polygons(
    tmp_path: Path, layout: str, kind: str, length: str
) -> None:
    content = ply(*prism(L_SHAPE), layout, kind=kind, length=length)
    mesh = load_mesh(written(tmp_path, "prism.ply", content))
    assert (len(mesh.V), len(mesh.F)) == (12, 20)
    assert mesh.volume == pytest.approx(3)
    assert load_mesh(
        written(tmp_path, "quads.ply", ply(CORNERS, QUADS, layout, kind=kind))
    ).volume == pytest.approx(1)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("length", ["ushort", "int"])
def test_lists_of_any_lengths_are_read(tmp_path: Path, layout: str, length: str) -> None:
    angle = 2 * np.pi * np.arange(300) / 300
    vertices, faces = prism([*zip(np.cos(angle), np.sin(angle), strict=True)])
    content = ply(vertices, [(), (0,), *faces, (1, 2)], layout, kind="double", length=length)
    mesh = load_mesh(written(tmp_path, "disk.ply", content))
    assert mesh.closed and mesh.notes == ("3 faces with fewer than three corners left out",)
    assert mesh.volume == pytest.approx(150 * np.sin(2 * np.pi / 300), rel=1e-5)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("faces", [QUADS, prism(L_SHAPE)[1]], ids=["one length", "two lengths"])
def test_a_file_that_ends_early_is_refused_wherever_it_ends(
    tmp_path: Path, layout: str, faces: list
) -> None:
    whole = ply(prism(L_SHAPE)[0], faces, layout)
    if layout == "ascii":
        whole = whole[:-1]  # the last row needs no line end
    assert load_mesh(written(tmp_path, "whole.ply", whole)).closed
    for end in range(whole.index(b"end_header"), len(whole)):
        with pytest.raises(
            MeshError, match=r"no header|ends before the \d+ rows of its element|not understood"
        ):
            load_mesh(written(tmp_path, "part.ply", whole[:end]))


@pytest.mark.parametrize("layout", ["ascii", "binary_little_endian"])
def test_texture_coordinates_of_the_corners_of_a_ply_file(tmp_path: Path, layout: str) -> None:
    mesh = load_mesh(written(tmp_path, "box.ply", ply(CORNERS, QUADS, layout, texcoord=True)))
    assert mesh.corner_uv is not None
    for triangle, pairs in zip(mesh.F, mesh.corner_uv, strict=True):
        quad = QUADS[int(pairs[0, 0])]
        assert [quad[int(j)] for j in pairs[:, 1]] == [
            CORNERS.index(tuple(mesh.V[vertex])) for vertex in triangle
        ]


HEXAGON = [(np.cos(a), np.sin(a)) for a in np.arange(6) * np.pi / 3]
COMB = [
    (0, 0),
    (7, 0),
    (7, 3),
    (6, 3),
    (6, 1),
    (4, 1),
    (4, 3),
    (3, 3),
    (3, 1),
    (1, 1),
    (1, 3),
    (0, 3),
]


@pytest.mark.parametrize(("outline", "area"), [(L_SHAPE, 3), (HEXAGON, 1.5 * 3**0.5), (COMB, 13)])
@pytest.mark.parametrize("write", [obj, off])
@pytest.mark.parametrize("turn", range(3))
def test_polygons_are_cut_without_folds(
    tmp_path: Path, outline, area: float, write, turn: int
) -> None:
    vertices, faces = prism(outline[turn:] + outline[:turn])
    vertices = [np.roll(v, turn) for v in vertices]  # each axis is the polygon's normal once
    mesh = load_mesh(written(tmp_path, f"prism.{write.__name__}", write(vertices, faces)))
    perimeter = np.linalg.norm(np.diff([*outline, outline[0]], axis=0), axis=1).sum()
    assert mesh.volume == pytest.approx(area, rel=1e-5)
    # folded triangles would count twice
    assert mesh.area == pytest.approx(2 * area + perimeter, rel=1e-5)


def test_triangulation_keeps_the_winding_of_turned_polygons() -> None:
    rng = np.random.default_rng(0)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 20))
    star = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(20)]) * rng.uniform(
        0.3, 1, (20, 1)
    )
    rotation = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    turned = star @ rotation.T + 5
    triangles = triangulate(turned, np.array([20]))
    assert sorted(np.unique(triangles)) == list(range(20))
    first, second, third = np.moveaxis(turned[triangles], 1, 0)
    normals = np.cross(second - first, third - first)
    assert (normals @ rotation[:, 2] > 0).all()
    shoelace = np.cross(star, np.roll(star, -1, axis=0))[:, 2].sum()
    assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(shoelace)


@pytest.mark.parametrize("write", [obj, off])
def test_faces_of_two_corners_are_left_out_and_counted(tmp_path: Path, write) -> None:
    mesh = load_mesh(
        written(tmp_path, f"box.{write.__name__}", write(CORNERS, [*QUADS, (0, 1), (2, 3)]))
    )
    assert mesh.closed
    assert mesh.notes == ("2 faces with fewer than three corners left out",)
