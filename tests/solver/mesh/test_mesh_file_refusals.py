"""Mesh files as they are found: every format, polygons, seams, nodes; and what is refused, always with one line."""

from __future__ import annotations

import json
import os
import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_text import CORNERS, QUADS, obj, off, ply, written

from ripple_sim.solver import MeshError, load_mesh

FORMATS = ("obj", "off", "ply", "stl", "glb")


def refusal(path: Path) -> str:
    with pytest.raises(MeshError) as error:
        load_mesh(path)
    assert "\n" not in str(error.value)
    assert path.name in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("empty.obj", "", "is empty"),
        ("blank.obj", "\n\n", "no triangles"),
        ("points.obj", obj(CORNERS, []), "no triangles, only 8 points; make a surface of them first"),
        ("lines.obj", obj(CORNERS, []) + "l 1 2\n", "no triangles"),
        ("edges.obj", obj(CORNERS, [(0, 1)]), "no triangles"),
        ("huge.obj", obj(CORNERS, [*QUADS, (0, 1, 999_999_999)]), "line 15 refers to vertex 1000000000.*1 to 8"),
        ("huger.obj", obj(CORNERS, QUADS) + f"f 1 2 {10**30}\n", "line 15.*not a corner"),
        ("zero.obj", obj(CORNERS, QUADS) + "f 0 1 2\n", "line 15 refers to vertex 0"),
        ("back.obj", obj(CORNERS, QUADS) + "f -9 1 2\n", "line 15 refers to vertex 0"),
        ("word.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 zero 1"), "not a number.*zero"),
        ("short.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0"), "line 2 has 2 coordinates"),
        ("nan.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0 nan"), "1 vertices are NaN"),
        ("infinite.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0 1e999"), "NaN or infinite"),
        ("no.off", "8 6 0\n", "does not start with OFF"),
        ("early.off", off(CORNERS, QUADS)[:60], "ends early"),
        ("counts.off", "OFF\nmany 3\n", "numbers of vertices and faces"),
        ("range.off", off(CORNERS, [*QUADS, (0, 1, 8)]), "outside 0 to 7"),
        ("missing.off", off(CORNERS, QUADS).replace("4 0 1 3 2", "4 0 1 3"), "has 3 corners instead of 4"),
        ("cloud.ply", ply(CORNERS, [], "ascii"), "no triangles, only 8 points"),
        ("missing.ply", ply(CORNERS, QUADS, "ascii").replace(b"4 0 1 3 2", b"4 0 1 3"), "ends before the 6 rows"),
        ("junk.ply", b"\x00\x01", "no header from ply to end_header"),
        ("early.ply", ply(CORNERS, QUADS, "binary_little_endian")[:-30], "ends before the 6 rows of its element face"),
        ("lines.ply", ply(CORNERS, QUADS, "ascii")[:-30], "not understood|ends before"),
        ("range.ply", ply(CORNERS, [*QUADS, (0, 1, 8)], "ascii"), "vertices 0 to 8; valid is 0 to 7"),
        ("type.ply", ply(CORNERS, QUADS, "ascii").replace(b"uchar red", b"colour red"), "'property colour red'"),
        ("flat.ply", ply(CORNERS, QUADS, "ascii").replace(b"float z", b"float w"), "no vertices with x, y and z"),
        ("junk.glb", b"glTF junk", "damaged or not a GLB file"),
        ("junk.stl", b"solid nothing", "no triangles|damaged"),
        ("cloud.xyz", "1 2 3\n4 5 6\n", "no triangles, only 2 points"),
        ("notes.txt", "hello", "unknown ending; valid are .obj"),
        ("noending", "hello", "unknown ending"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_line(tmp_path: Path, name: str, content, said: str) -> None:
    message = refusal(written(tmp_path, name, content))
    assert re.search(said, message), message


def test_folders_and_missing_files_are_named(tmp_path: Path) -> None:
    assert "is a folder" in refusal(tmp_path)
    (tmp_path / "folder.obj").mkdir()
    assert "is a folder" in refusal(tmp_path / "folder.obj")
    assert "does not exist" in refusal(tmp_path / "missing.obj")
    assert "does not exist" in refusal(tmp_path / "missing" / "deep.obj")
    (tmp_path / "dangling.obj").symlink_to(tmp_path / "nothing.obj")
    assert "does not exist" in refusal(tmp_path / "dangling.obj")
    assert "cannot be read" in refusal(tmp_path / ("long" * 100 + ".obj"))


@pytest.mark.parametrize("method", ["stat", "open"])
def test_a_place_without_permission_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    path = written(tmp_path, "box.obj", obj(CORNERS, QUADS))
    original = getattr(Path, method)

    def refused(self, *args, **kwargs):
        if self == path:
            raise PermissionError(13, os.strerror(13), str(path))
        return original(self, *args, **kwargs)

    monkeypatch.setattr(Path, method, refused)
    assert "Permission denied" in refusal(path)


def sample_files() -> dict[str, bytes]:
    ball = trimesh.creation.icosphere(subdivisions=1)
    files = {}
    for ending in FORMATS:
        content = ball.export(file_type=ending)
        files[ending] = content.encode() if isinstance(content, str) else content
    return files


SAMPLES = sample_files()


@pytest.mark.parametrize("ending", FORMATS)
def test_truncated_and_garbled_files_give_a_mesh_or_one_line(tmp_path: Path, ending: str) -> None:
    whole = SAMPLES[ending]
    rng = np.random.default_rng(zlib.crc32(ending.encode()))
    assert len(load_mesh(written(tmp_path, f"whole.{ending}", whole)).F) == 80
    refused = 0
    for trial in range(45):
        damaged = bytearray(whole)
        if trial % 3 == 0:
            del damaged[rng.integers(len(whole)) :]
        elif trial % 3 == 1:
            for place in rng.integers(len(whole), size=rng.integers(1, 20)):
                damaged[place] = rng.integers(256)
        else:  # where counts and sizes stand
            for place in rng.integers(min(400, len(whole)), size=3):
                damaged[place] = rng.choice(np.frombuffer(b"09-.\x00\xff\x7f \n", np.uint8))
        try:
            mesh = load_mesh(written(tmp_path, f"damaged.{ending}", bytes(damaged)))
        except MeshError as error:
            assert "\n" not in str(error)
            refused += 1
        else:
            assert np.isfinite(mesh.V).all()
    assert refused > 10


def test_nothing_but_the_error_is_said(tmp_path: Path) -> None:
    broken = trimesh.creation.box().export(file_type="stl_ascii").replace("normal 0", "normal zero", 1)
    path = written(tmp_path, "broken.stl", broken)
    code = (
        f"from ripple_sim.solver import load_mesh\ntry: load_mesh({str(path)!r})\nexcept Exception as e: print(type(e))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stderr == ""


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("promise.stl", b"\x00" * 80 + struct.pack("<I", 2**32 - 1) + b"\x00" * 50),
        (
            "promise.ply",
            ply(CORNERS, QUADS, "binary_little_endian").replace(b"vertex 8", b"vertex 900000000000"),
        ),
        ("promise.off", b"OFF\n900000000000 900000000000 0\n0 0 0\n"),
        ("promise.glb", b"glTF" + struct.pack("<III", 2, 2**32 - 1, 2**32 - 1) + b"JSON{}"),
    ],
)
def test_a_file_that_promises_too_much_is_refused_at_once(tmp_path: Path, name: str, content: bytes) -> None:
    refusal(written(tmp_path, name, content))


@pytest.mark.parametrize("kind", ["buffers", "images"])
def test_a_gltf_whose_buffer_is_a_fifo_does_not_wait_for_it(tmp_path: Path, kind: str) -> None:
    os.mkfifo(tmp_path / "a pipe")
    content = {"asset": {"version": "2.0"}, kind: [{"uri": "a%20pipe", "byteLength": 12}]}
    (tmp_path / "mesh.gltf").write_text(json.dumps(content))
    with pytest.raises(
        MeshError, match=r"mesh\.gltf' cannot be read: it names 'a%20pipe', which .* not a regular file"
    ):
        load_mesh(tmp_path / "mesh.gltf")


def test_a_fifo_is_no_mesh_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "mesh.obj")
    with pytest.raises(MeshError, match=r"mesh\.obj' is not a regular file; give the path of an OBJ"):
        load_mesh(tmp_path / "mesh.obj")
