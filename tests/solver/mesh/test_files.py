"""Mesh files: formats, polygons, seams, nodes, transforms; refusals in one line."""

import json
import os
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from all_kinds import BALL, crumbs
from gltf_files import Gltf
from known_meshes import known_mesh
from mesh_text import CORNERS, QUADS, obj, off, ply, written
from programs import PROGRAMS, ended
from scipy.spatial import cKDTree
from sound import assert_sound, assert_unchanged_when_read_again

from ripple_sim.solver import MeshError, load_mesh
from ripple_sim.solver.mesh import check_genus_zero


def test_files_of_every_format_give_the_same_surface(tmp_path: Path) -> None:
    solid = trimesh.creation.icosphere(subdivisions=2)
    for ending in ("obj", "ply", "stl", "off", "glb"):
        solid.export(tmp_path / f"ball.{ending}")
        mesh = load_mesh(tmp_path / f"ball.{ending}")
        assert (len(mesh.V), len(mesh.F)) == (162, 320), ending
        assert mesh.volume == pytest.approx(solid.volume, rel=1e-5)


@pytest.mark.parametrize(
    ("file", "said"),
    [
        ("genus1-rocker-arm.obj", "genus 1"),
        ("genus3-3holes.off", "genus 3"),
        ("open-camelhead.off", "open: 56 boundary edges round 1 hole"),
        ("several-parts-teapot.obj", "4 separate parts.*open: 160 boundary edges round 6 holes"),
        ("suzanne.obj", "separate parts.*cut apart along 1 edge"),
    ],
)
def test_public_meshes_with_handles_or_holes_are_read_and_refused_for_the_cube(
    file: str, said: str
) -> None:
    mesh = load_mesh(known_mesh(f"bad/{file}"))
    assert_sound(mesh)
    assert_unchanged_when_read_again(mesh)
    with pytest.raises(MeshError, match=rf"{file}.*{said}"):
        check_genus_zero(mesh)


@pytest.mark.parametrize("file", ["nonmanifold-cow.obj", "nonmanifold-camel_b.obj"])
def test_public_meshes_that_touch_themselves_fit_the_cube_after_cutting(file: str) -> None:
    mesh = load_mesh(known_mesh(f"bad/{file}"))
    assert_unchanged_when_read_again(mesh)
    assert mesh.notes[-1] == "cut apart at 1 vertex where the surface touched itself"
    check_genus_zero(mesh)


def test_many_parts_are_advised_to_be_wrapped(tmp_path: Path) -> None:
    V, F = crumbs(101)
    trimesh.Trimesh(V, F, process=False).export(tmp_path / "crumbs.off")
    mesh = load_mesh(tmp_path / "crumbs.off")
    assert mesh.notes[-1] == "wrap (--wrap) would put one closed surface round its 101 parts"
    with pytest.raises(MeshError, match=r"101 separate parts.*--wrap"):
        check_genus_zero(mesh)
    assert load_mesh(tmp_path / "crumbs.off", wrap=True).notes[-1].startswith("wrapped, ")


def test_nodes_of_a_scene_are_put_where_their_transforms_say(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    lower = trimesh.Trimesh(box.vertices, box.faces[:5], process=False)
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], point=[5, 1, 2])
    back = trimesh.transform_points(box.vertices, np.linalg.inv(turn))
    upper = trimesh.Trimesh(back, box.faces[5:], process=False)
    scene = trimesh.Scene()
    scene.add_geometry(lower, node_name="lower")
    scene.add_geometry(upper, node_name="upper", transform=turn)
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    # the transform leaves round-off between the parts, which are joined all the same
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert mesh.volume == pytest.approx(1, rel=1e-5)


def test_scaled_mirrored_and_nested_nodes(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    scene.add_geometry(
        BALL, node_name="ball", parent_node_name="arm", transform=np.diag([-2, 1, 1, 1])
    )
    scene.graph.update(frame_to="arm", frame_from="world", matrix=np.diag([1.0, 3.0, 1.0, 1.0]))
    scene.export(tmp_path / "nested.glb")
    mesh = load_mesh(tmp_path / "nested.glb")
    np.testing.assert_allclose(np.ptp(mesh.V, axis=0), [4, 6, 2], rtol=0.2)
    assert mesh.volume == pytest.approx(6 * BALL.volume, rel=1e-5)


def test_texture_of_a_glb_is_kept(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    uv = np.random.default_rng(0).uniform(size=(len(ball.vertices), 2))
    ball.visual = trimesh.visual.TextureVisuals(uv=uv)
    ball.export(tmp_path / "ball.glb")
    mesh = load_mesh(tmp_path / "ball.glb")
    assert mesh.uv is not None
    distance, same = cKDTree(ball.vertices).query(mesh.V)
    assert distance.max() < 1e-6
    np.testing.assert_allclose(mesh.uv, uv[same], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("quads.obj", obj(CORNERS, QUADS)),
        ("crlf.obj", obj(CORNERS, QUADS).replace("\n", "\r\n")),
        ("marked.obj", "\ufeff" + obj(CORNERS, QUADS)),
        ("UPPER.OBJ", obj(CORNERS, QUADS)),
        ("continued.obj", obj(CORNERS, QUADS).replace("f 1 2", "f 1 \\\n2")),
        ("comments.obj", "# box\n" + obj(CORNERS, QUADS).replace("\n", " # corner\n")),
        ("colours.obj", obj([(*c, 0.5, 0.5, 0.5) for c in CORNERS], QUADS)),
        (
            "groups.obj",
            obj(CORNERS, QUADS, "mtllib none.mtl", "o box", "g side", "usemtl red", "s 1"),
        ),
        ("quads.off", off(CORNERS, QUADS)),
        ("marked.off", "\ufeff" + off(CORNERS, QUADS)),
        ("one_line.off", off(CORNERS, QUADS).replace("OFF\n", "OFF ")),
        (
            "comments.off",
            "# box\n" + off(CORNERS, QUADS).replace("OFF\n", "OFF # text\n\n# counts\n"),
        ),
        ("colours.off", off([(*c, 255, 0, 0, 255) for c in CORNERS], QUADS, "COFF")),
        ("normals.off", off([(*c, 0, 0, 1) for c in CORNERS], QUADS, "NOFF")),
    ],
)
def test_a_box_of_quads_is_read(tmp_path: Path, name: str, text: str) -> None:
    mesh = load_mesh(written(tmp_path, name, text))
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert mesh.volume == pytest.approx(1)
    assert mesh.notes == ()


def test_negative_indices_count_back_from_their_own_line(tmp_path: Path) -> None:
    text = "".join(obj([CORNERS[i] for i in quad], []) + "f -4 -3 -2 -1\n" for quad in QUADS)
    mesh = load_mesh(written(tmp_path, "relative.obj", text))
    assert (len(mesh.V), mesh.volume) == (8, pytest.approx(1))


def test_materials_and_uv_seams_keep_every_corners_coordinates(tmp_path: Path) -> None:
    text = [f"v {x} {y} {z}" for x, y, z in CORNERS] + ["mtllib some.mtl"]
    for k, quad in enumerate(QUADS):
        text += [f"vt {k + u} {v}" for u, v in ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5))]
        text += [
            f"usemtl material{k}",
            "f " + " ".join(f"{i + 1}/{4 * k + j + 1}" for j, i in enumerate(quad)),
        ]
    mesh = load_mesh(written(tmp_path, "seams.obj", "\n".join(text)))
    assert mesh.corner_uv is not None and mesh.uv is not None
    assert (len(mesh.V), mesh.corner_uv.shape, mesh.uv.shape) == (8, (12, 3, 2), (8, 2))
    for triangle, pairs in zip(mesh.F, mesh.corner_uv, strict=True):
        [k] = np.unique(np.floor(pairs[:, 0]))
        quad = QUADS[int(k)]
        for vertex, pair in zip(triangle, pairs, strict=True):
            j = quad.index(CORNERS.index(tuple(mesh.V[vertex])))
            np.testing.assert_array_equal(
                pair - [k, 0], [(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5)][j]
            )


def test_faces_without_texture_coordinates_among_others_are_read(tmp_path: Path) -> None:
    others = "".join("f " + " ".join(f"{i + 1}/1" for i in quad) + "\n" for quad in QUADS[3:])
    mesh = load_mesh(written(tmp_path, "mixed.obj", obj(CORNERS, QUADS[:3], "vt 0.5 0.5") + others))
    assert mesh.corner_uv is not None
    assert sorted(np.unique(mesh.corner_uv)) == [0, 0.5]


TEXT, BINARY = (
    ply(CORNERS, QUADS, layout, length="int") for layout in ("ascii", "binary_little_endian")
)
MANY = b"vertex 900000000000"


def with_length(corners: int) -> bytes:
    """A PLY file whose first face has a list of another length than it says."""
    return BINARY.replace(struct.pack("<5i", 4, *QUADS[0]), struct.pack("<5i", corners, *QUADS[0]))


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
        (
            "points.obj",
            obj(CORNERS, []),
            "no triangles, only 8 points; make a surface of them first",
        ),
        ("edges.obj", obj(CORNERS, [(0, 1)]), "no triangles"),
        (
            "huge.obj",
            obj(CORNERS, [*QUADS, (0, 1, 999_999_999)]),
            "line 15 refers to vertex 1000000000.*1 to 8",
        ),
        (
            "huger.obj",
            obj(CORNERS, QUADS) + f"f 1 2 {10**30}\n",
            "line 15: a corner of a face must be",
        ),
        ("zero.obj", obj(CORNERS, QUADS) + "f 0 1 2\n", "line 15 refers to vertex 0"),
        ("back.obj", obj(CORNERS, QUADS) + "f -9 1 2\n", "line 15 refers to vertex 0"),
        ("word.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 zero 1"), "not a number.*zero"),
        (
            "short.obj",
            obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0"),
            "line 2 must have 3 coordinates, got 2",
        ),
        ("nan.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0 nan"), "1 vertices are NaN"),
        ("infinite.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0 1e999"), "NaN or infinite"),
        ("no.off", "8 6 0\n", "does not start with OFF"),
        ("early.off", off(CORNERS, QUADS)[:60], "ends early"),
        ("counts.off", "OFF\nmany 3\n", "numbers of vertices and faces"),
        ("range.off", off(CORNERS, [*QUADS, (0, 1, 8)]), "outside 0 to 7"),
        (
            "missing.off",
            off(CORNERS, QUADS).replace("4 0 1 3 2", "4 0 1 3"),
            "has 3 corners instead of 4",
        ),
        ("cloud.ply", ply(CORNERS, [], "ascii"), "no triangles, only 8 points"),
        ("missing.ply", TEXT.replace(b"4 0 1 3 2", b"4 0 1 3"), "ends before the 6 rows"),
        ("junk.ply", b"\x00\x01", "no header from ply to end_header"),
        ("word.ply", TEXT.replace(b"4 0 1 3 2", b"4 0 1 three 2"), "face is not understood"),
        ("many.ply", TEXT.replace(b"4 0 1 3 2", b"four 0 1 3 2"), "face is not understood"),
        ("less.ply", TEXT.replace(b"4 0 1 3 2", b"-1 0 1 3 2"), "ends before the 6 rows"),
        ("minus.ply", with_length(-1), "ends before"),
        ("endless.ply", with_length(2**31 - 1), "ends before"),
        (
            "range.ply",
            ply(CORNERS, [*QUADS, (0, 1, 8)], "ascii"),
            "must be 0 to 7, got 0 to 8",
        ),
        ("type.ply", TEXT.replace(b"uchar red", b"colour red"), "'property colour red'"),
        ("flat.ply", TEXT.replace(b"float z", b"float w"), "no vertices with x, y and z"),
        ("junk.glb", b"glTF junk", "ends within its header"),
        ("junk.stl", b"solid nothing", "no triangles|damaged"),
        ("cloud.xyz", "1 2 3\n4 5 6\n", "no triangles, only 2 points"),
        ("notes.txt", "hello", "unknown ending: mesh files must end in .obj"),
        ("noending", "hello", "unknown ending"),
        # what promises more than it holds is refused at once, and no memory asked for
        ("promise.stl", b"\x00" * 80 + struct.pack("<I", 2**32 - 1) + b"\x00" * 50, "ends early"),
        (
            "promise.ply",
            BINARY.replace(b"vertex 8", MANY),
            "ends before the 900000000000 rows of its element vertex",
        ),
        (
            "rows.ply",
            TEXT.replace(b"vertex 8", MANY),
            "ends before the 900000000000 rows of its element vertex",
        ),
        (
            "faces.ply",
            TEXT.replace(b"face 6", b"face 900000000000"),
            "ends before the 900000000000 rows",
        ),
        (
            "promise.off",
            b"OFF\n900000000000 900000000000 0\n0 0 0\n",
            "900000000000 faces are announced, 1 lines",
        ),
        (
            "promise.glb",
            b"glTF" + struct.pack("<III", 2, 2**32 - 1, 2**32 - 1) + b"JSON{}",
            "ends early",
        ),
    ],
)
def test_unreadable_files_are_refused_in_one_line(
    tmp_path: Path, name: str, content, said: str
) -> None:
    message = refusal(written(tmp_path, name, content))
    assert re.search(said, message), message


def test_folders_fifos_and_missing_files_are_named(tmp_path: Path) -> None:
    assert "is a folder" in refusal(tmp_path)
    (tmp_path / "folder.obj").mkdir()
    assert "is a folder" in refusal(tmp_path / "folder.obj")
    os.mkfifo(tmp_path / "fifo.obj")
    assert "fifo.obj' is not a regular file; give the path of an OBJ" in refusal(
        tmp_path / "fifo.obj"
    )
    assert "does not exist" in refusal(tmp_path / "missing.obj")
    assert "does not exist" in refusal(tmp_path / "missing" / "deep.obj")
    (tmp_path / "dangling.obj").symlink_to(tmp_path / "nothing.obj")
    assert "does not exist" in refusal(tmp_path / "dangling.obj")
    assert "cannot be read" in refusal(tmp_path / ("long" * 100 + ".obj"))


@pytest.mark.parametrize("method", ["stat", "open"])
def test_a_place_without_permission_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    path = written(tmp_path, "box.obj", obj(CORNERS, QUADS))
    original = getattr(Path, method)

    def refused(self, *args, **kwargs):
        if self == path:
            raise PermissionError(13, os.strerror(13), str(path))
        return original(self, *args, **kwargs)

    monkeypatch.setattr(Path, method, refused)
    assert "Permission denied" in refusal(path)


def test_the_error_is_the_only_output(tmp_path: Path) -> None:
    broken = (
        trimesh.creation.box().export(file_type="stl_ascii").replace("normal 0", "normal zero", 1)
    )
    path = written(tmp_path, "broken.stl", broken)
    assert ended(PROGRAMS / "read_mesh.py", path, check=True).stderr == ""


def test_a_gltf_whose_buffer_is_a_fifo_does_not_wait_for_it(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a pipe")
    file = Gltf()
    file.show(file.primitive())
    content = file.root | {"buffers": [{"uri": "a%20pipe", "byteLength": len(file.data)}]}
    (tmp_path / "mesh.gltf").write_text(json.dumps(content))
    said = refusal(tmp_path / "mesh.gltf")
    assert re.search(
        r"mesh\.gltf' cannot be read: it names 'a%20pipe', which .* not a regular file", said
    )
