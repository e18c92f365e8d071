"""Rows of PLY files: text and binary alike, lists of any length, and files that end early."""

import struct
from collections.abc import Callable

import numpy as np
import pytest

from ripple_sim.solver.errors import MeshError
from ripple_sim.solver.mesh.ply import Element, read_binary, read_text

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
