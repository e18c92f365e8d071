"""Rows of PLY files: text and binary alike, lists of any length, and files that end early.

PLY files: text and binary, mixed polygons, texture coordinates.

Polygons are cut into triangles without folds.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mesh_text import CORNERS, L_SHAPE, QUADS, obj, off, ply, prism, written

from ripple_sim.solver import load_mesh
from ripple_sim.solver.errors import MeshError
from ripple_sim.solver.mesh.ply import Element, read_binary, read_text, triangulate

CODES = {"u1": "B", "i2": "h", "i4": "i", "f4": "f", "f8": "d"}
REST = b"what follows"


def points(rows: int) -> Element:
    return Element("vertex", rows, ["x", "flag"], ["f4", "u1"], [None, None])


def polygons(rows: int, length: str = "u1") -> Element:
    return Element("face", rows, ["corners", "area"], ["i4", "f8"], [length, None])


def content(element: Element, rows: list[list], order: str) -> bytes:
    """Rows of values, lists among them, as text (order "") or binary."""
    if order == "":
        flat = [[x for each in row for x in ([len(each), *each] if isinstance(each, list) else [each])] for row in rows]
        return b"".join(" ".join(map(str, row)).encode() + b"\n" for row in flat)
    packed = b""
    for row in rows:
        for each, kind, length in zip(row, element.types, element.lengths, strict=True):
            if length is not None:
                packed += struct.pack(order + CODES[length], len(each))
            values = each if isinstance(each, list) else [each]
            packed += struct.pack(f"{order}{len(values)}{CODES[kind]}", *values)
    return packed


def reader(order: str) -> Callable:
    return read_text if order == "" else read_binary


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_table_of_numbers_comes_back_with_what_follows(order: str) -> None:
    rows = [[0.5, 7], [-2.25, 255], [1024.0, 0]]
    columns, rest = reader(order)(points(3), content(points(3), rows, order) + REST, order)
    np.testing.assert_array_equal(columns["x"], [row[0] for row in rows])
    np.testing.assert_array_equal(columns["flag"], [row[1] for row in rows])
    assert rest == REST


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("length", ["u1", "i4"])
@pytest.mark.parametrize("sizes", [(3, 3, 3), (3, 4, 3), (4, 0, 1), (0, 0, 0), (300,)], ids=str)
def test_lists_of_any_lengths_come_back_with_what_follows(order: str, length: str, sizes: tuple[int, ...]) -> None:
    if length == "u1" and max(sizes) > 255:
        length = "i2"
    element = polygons(len(sizes), length)
    rows = [[list(range(10 * i, 10 * i + size)), i + 0.5] for i, size in enumerate(sizes)]
    columns, rest = reader(order)(element, content(element, rows, order) + REST, order)
    assert [[int(x) for x in each] for each in columns["corners"]] == [row[0] for row in rows]
    assert [float(np.squeeze(x)) for x in columns["area"]] == [row[1] for row in rows]
    assert rest == REST


@pytest.mark.parametrize("order", ["", "<", ">"])
@pytest.mark.parametrize("element", [points(0), polygons(0), Element("nothing", 0)], ids=["table", "lists", "bare"])
def test_an_element_without_rows_takes_nothing(order: str, element: Element) -> None:
    columns, rest = reader(order)(element, REST, order)
    assert rest == REST
    assert all(len(column) == 0 for column in columns.values())


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("sizes", [(3, 3), (3, 4)], ids=["one length", "two lengths"])
def test_binary_rows_that_end_early_are_an_error_wherever_they_end(order: str, sizes: tuple[int, ...]) -> None:
    element = polygons(len(sizes))
    whole = content(element, [[list(range(size)), 1.0] for size in sizes], order)
    for end in range(len(whole)):
        with pytest.raises(MeshError, match="it ends before the 2 rows of its element face"):
            read_binary(element, whole[:end], order)


@pytest.mark.parametrize("data", [b"", b"1 2\n", b"1 2\n3 4", b"1 2\n3 4\n", b"1 2\n3 4\n  "])
def test_text_rows_that_end_early_are_an_error(data: bytes) -> None:
    with pytest.raises(MeshError, match="it ends before the 3 rows of its element vertex"):
        read_text(points(3), data, "")


def test_the_last_text_row_needs_no_line_end() -> None:
    columns, rest = read_text(points(2), b"1 2\r\n3 4", "")
    assert [*columns["x"]] == [1, 3] and rest == b""


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("3 0 1", "ends before the 1 rows"),
        ("-1 0 1 2 0.5", "ends before the 1 rows"),
        ("3 0 1 two 0.5", "a row of its element face is not understood"),
        ("three 0 1 2 0.5", "a row of its element face is not understood"),
        ("3 0 1 2 wide", "a row of its element face is not understood"),
    ],
)
def test_a_text_row_that_makes_no_sense_is_an_error(row: str, message: str) -> None:
    with pytest.raises(MeshError, match=message):
        read_text(polygons(1), f"{row}\n".encode(), "")


@pytest.mark.parametrize("size", [-1, -(2**31), 2**31 - 1])
def test_a_binary_list_of_impossible_length_is_an_error_and_not_reserved(size: int) -> None:
    data = struct.pack("<i3id", size, 0, 1, 2, 0.5)
    with pytest.raises(MeshError, match="ends before"):
        read_binary(polygons(1, "i4"), data, "<")


@pytest.mark.parametrize("order", ["", "<"])
def test_more_rows_than_any_file_has_are_an_error_at_once(order: str) -> None:
    for element in (points(10**15), polygons(10**15)):
        with pytest.raises(MeshError, match="ends before"):
            reader(order)(element, b"3 0 1 2 0.5\n" * 3, order)


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
