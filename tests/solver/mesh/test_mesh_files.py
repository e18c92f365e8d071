"""Mesh files as they are found: every format, polygons, seams, nodes; and what is refused, always with one line."""

from __future__ import annotations

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
from scipy.spatial import cKDTree

from ripple_sim.solver import Mesh, MeshError, load_mesh
from ripple_sim.solver.mesh.polygons import triangulate

QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FORMATS = ("obj", "off", "ply", "stl", "glb")


def obj(vertices, faces, *between: str) -> str:
    """OBJ text of polygons given by indices from 0."""
    lines = [f"v {' '.join(f'{x:g}' for x in v)}" for v in vertices]
    return "\n".join([*lines, *between, *(f"f {' '.join(str(i + 1) for i in f)}" for f in faces)]) + "\n"


def off(vertices, faces, header: str = "OFF") -> str:
    lines = [header, f"{len(vertices)} {len(faces)} 0", *(" ".join(f"{x:g}" for x in v) for v in vertices)]
    return "\n".join([*lines, *(f"{len(f)} {' '.join(map(str, f))}" for f in faces)]) + "\n"


def ply(vertices, faces, layout: str, *, kind: str = "float", length: str = "uchar", texcoord: bool = False) -> bytes:
    """PLY file with an element of edges between vertices and faces, and properties that mean nothing here."""
    order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}[layout]
    codes = {"float": "f", "double": "d", "uchar": "B", "int": "i"}
    header = ["ply", f"format {layout} 1.0", "comment made here", f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for name in "xyz"] + ["property uchar red"]
    header += ["element edge 1", "property int vertex1", "property int vertex2", f"element face {len(faces)}"]
    header += [f"property list {length} int vertex_indices"]
    header += ["property list uchar float texcoord"] * texcoord + ["property uchar flags", "end_header"]
    rows = [[(codes[kind], [*v]), ("B", [255])] for v in vertices] + [[("i", [0, 1])]]
    for k, face in enumerate(faces):
        rows.append([(codes[length], [len(face)]), ("i", [*face])])
        if texcoord:
            rows[-1] += [("B", [2 * len(face)]), ("f", [x for j in range(len(face)) for x in (k, j)])]
        rows[-1].append(("B", [7]))
    if order is None:
        body = "".join(" ".join(f"{x:g}" for _, values in row for x in values) + "\n" for row in rows).encode()
    else:
        body = b"".join(struct.pack(f"{order}{len(values)}{code}", *values) for row in rows for code, values in row)
    return "\n".join(header).encode() + b"\n" + body


def prism(outline) -> tuple[list, list]:
    """Vertices and polygons of a prism of height 1 over an outline (x, y), counter-clockwise."""
    n = len(outline)
    vertices = [(x, y, z) for z in (0, 1) for x, y in outline]
    sides = [(i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n)]
    return vertices, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides]


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(MeshError) as error:
        load_mesh(path)
    assert "\n" not in str(error.value)
    assert path.name in str(error.value)
    return str(error.value)


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
        ("groups.obj", obj(CORNERS, QUADS, "mtllib none.mtl", "o box", "g side", "usemtl red", "s 1")),
        ("quads.off", off(CORNERS, QUADS)),
        ("marked.off", "\ufeff" + off(CORNERS, QUADS)),
        ("one_line.off", off(CORNERS, QUADS).replace("OFF\n", "OFF ")),
        ("comments.off", "# box\n" + off(CORNERS, QUADS).replace("OFF\n", "OFF # text\n\n# counts\n")),
        ("colours.off", off([(*c, 255, 0, 0, 255) for c in CORNERS], QUADS, "COFF")),
        ("normals.off", off([(*c, 0, 0, 1) for c in CORNERS], QUADS, "NOFF")),
    ],
)
def test_a_box_of_quads_is_read(tmp_path: Path, name: str, text: str) -> None:
    mesh = load_mesh(written(tmp_path, name, text))
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert mesh.volume == pytest.approx(1)
    assert mesh.fixes == ()


def test_negative_indices_count_back_from_their_own_line(tmp_path: Path) -> None:
    text = "".join(obj([CORNERS[i] for i in quad], []) + "f -4 -3 -2 -1\n" for quad in QUADS)
    mesh = load_mesh(written(tmp_path, "relative.obj", text))
    assert (len(mesh.V), mesh.volume) == (8, pytest.approx(1))


L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
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


def test_materials_and_uv_seams_keep_every_corners_coordinates(tmp_path: Path) -> None:
    text = [f"v {x} {y} {z}" for x, y, z in CORNERS] + ["mtllib some.mtl"]
    for k, quad in enumerate(QUADS):
        text += [f"vt {k + u} {v}" for u, v in ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5))]
        text += [f"usemtl material{k}", "f " + " ".join(f"{i + 1}/{4 * k + j + 1}" for j, i in enumerate(quad))]
    mesh = load_mesh(written(tmp_path, "seams.obj", "\n".join(text)))
    assert mesh.corner_uv is not None and mesh.uv is not None
    assert (len(mesh.V), mesh.corner_uv.shape, mesh.uv.shape) == (8, (12, 3, 2), (8, 2))
    for triangle, pairs in zip(mesh.F, mesh.corner_uv, strict=True):
        [k] = np.unique(np.floor(pairs[:, 0]))
        quad = QUADS[int(k)]
        for vertex, pair in zip(triangle, pairs, strict=True):
            j = quad.index(CORNERS.index(tuple(mesh.V[vertex])))
            np.testing.assert_array_equal(pair - [k, 0], [(0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5)][j])


def test_faces_without_texture_coordinates_among_others_are_read(tmp_path: Path) -> None:
    text = obj(CORNERS, QUADS[:3], "vt 0.5 0.5") + "".join(
        "f " + " ".join(f"{i + 1}/1" for i in quad) + "\n" for quad in QUADS[3:]
    )
    mesh = load_mesh(written(tmp_path, "mixed.obj", text))
    assert mesh.corner_uv is not None
    assert sorted(np.unique(mesh.corner_uv)) == [0, 0.5]


def test_nodes_of_a_scene_are_put_where_their_transforms_say(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    lower = trimesh.Trimesh(box.vertices, box.faces[:5], process=False)
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]) @ trimesh.transformations.translation_matrix(
        [5, 1, 2]
    )
    back = np.linalg.inv(turn)
    upper = trimesh.Trimesh(trimesh.transform_points(box.vertices, back), box.faces[5:], process=False)
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
        trimesh.creation.icosphere(subdivisions=1),
        node_name="ball",
        parent_node_name="arm",
        transform=np.diag([-2, 1, 1, 1]),
    )
    scene.graph.update(frame_to="arm", frame_from="world", matrix=np.diag([1.0, 3.0, 1.0, 1.0]))
    scene.export(tmp_path / "nested.glb")
    mesh = load_mesh(tmp_path / "nested.glb")
    np.testing.assert_allclose(np.ptp(mesh.V, axis=0), [4, 6, 2], rtol=0.2)
    assert mesh.volume == pytest.approx(6 * trimesh.creation.icosphere(subdivisions=1).volume, rel=1e-5)


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
    ("name", "content", "said"),
    [
        ("empty.obj", "", "is empty"),
        ("blank.obj", "\n\n", "no triangles"),
        ("points.obj", obj(CORNERS, []), "no triangles"),
        ("lines.obj", obj(CORNERS, []) + "l 1 2\n", "no triangles"),
        ("edges.obj", obj(CORNERS, [(0, 1)]), "no triangles"),
        ("one.obj", obj(CORNERS, [(0, 1, 2)]), "open: 3 boundary edges round 1 hole"),
        ("lid.obj", obj(CORNERS, QUADS[1:]), "open: 4 boundary edges round 1 hole"),
        ("holes.obj", obj(CORNERS, QUADS[2:]), "open: 8 boundary edges round 2 holes"),
        ("huge.obj", obj(CORNERS, [*QUADS, (0, 1, 999_999_999)]), "line 15 refers to vertex 1000000000.*1 to 8"),
        ("huger.obj", obj(CORNERS, QUADS) + f"f 1 2 {10**30}\n", "line 15.*not a corner"),
        ("zero.obj", obj(CORNERS, QUADS) + "f 0 1 2\n", "line 15 refers to vertex 0"),
        ("back.obj", obj(CORNERS, QUADS) + "f -9 1 2\n", "line 15 refers to vertex 0"),
        ("word.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 zero 1"), "not a number.*zero"),
        ("short.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0"), "line 2 has 2 coordinates"),
        ("nan.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0 nan"), "1 vertices are NaN"),
        ("infinite.obj", obj(CORNERS, QUADS).replace("v 0 0 1", "v 0 0 1e999"), "NaN or infinite"),
        ("flat.obj", obj([(x, y, 0) for x, y, _ in CORNERS], QUADS), "."),
        ("no.off", "8 6 0\n", "does not start with OFF"),
        ("early.off", off(CORNERS, QUADS)[:60], "ends early"),
        ("counts.off", "OFF\nmany 3\n", "numbers of vertices and faces"),
        ("range.off", off(CORNERS, [*QUADS, (0, 1, 8)]), "outside 0 to 7"),
        ("missing.off", off(CORNERS, QUADS).replace("4 0 1 3 2", "4 0 1 3"), "has 3 corners instead of 4"),
        ("junk.ply", b"\x00\x01", "no header from ply to end_header"),
        ("early.ply", ply(CORNERS, QUADS, "binary_little_endian")[:-30], "ends before the 6 rows of its element face"),
        ("lines.ply", ply(CORNERS, QUADS, "ascii")[:-30], "not understood|ends before"),
        ("range.ply", ply(CORNERS, [*QUADS, (0, 1, 8)], "ascii"), "vertices 0 to 8; valid is 0 to 7"),
        ("type.ply", ply(CORNERS, QUADS, "ascii").replace(b"uchar red", b"colour red"), "'property colour red'"),
        ("flat.ply", ply(CORNERS, QUADS, "ascii").replace(b"float z", b"float w"), "no vertices with x, y and z"),
        ("junk.glb", b"glTF junk", "damaged or not a GLB file"),
        ("junk.stl", b"solid nothing", "no triangles|damaged"),
        ("cloud.xyz", "1 2 3\n4 5 6\n", "no triangles"),
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


def test_hairline_cracks_are_closed_but_gaps_are_not() -> None:
    box = trimesh.creation.box()
    F = np.array(box.faces)
    apart = np.vstack([box.vertices, np.array(box.vertices) + 3e-8])
    mesh = Mesh.from_arrays(apart, np.vstack([F[:5], F[5:] + 8]))
    assert (len(mesh.V), len(mesh.F)) == (8, 12)
    assert any("cracks closed" in fix for fix in mesh.fixes)
    with pytest.raises(MeshError, match="boundary edges"):
        Mesh.from_arrays(np.vstack([box.vertices, np.array(box.vertices) + 1e-3]), np.vstack([F[:5], F[5:] + 8]))


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
    for trial in range(60):
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
