"""Materials and colours of OBJ, PLY, OFF and STL files, as many programs write them."""

import struct
from pathlib import Path

import numpy as np
import pytest
from gltf_files import png
from mesh_text import CORNERS, QUADS, written

from ripple_sim.solver import Mesh, MeshError, load_mesh
from ripple_sim.solver.mesh.looks import linear_light

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACES = "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
IMAGE = png([[[255, 0, 0]]])


def square(folder: Path, mtl: str | None = None, head: str = "mtllib a.mtl\nusemtl m\n") -> Mesh:
    if mtl is not None:
        (folder / "a.mtl").write_text(mtl)
    return load_mesh(written(folder, "a.obj", head + SQUARE + FACES))


def linear(*srgb: float) -> tuple:
    return pytest.approx((*linear_light(np.array(srgb[:3])), *srgb[3:]))


def test_each_face_has_the_material_before_it(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl red one\nKd 1 0 0\nnewmtl b#2\nKd 0 0 0.5\nd 0.25\n")
    text = SQUARE + "mtllib a.mtl\nusemtl b#2\nf 1 2 3\nusemtl red one\nf 1 3 4\n"
    looks = load_mesh(written(tmp_path, "a.obj", text)).looks
    paints = [looks.paints[number] for number in looks.paint]
    assert [paint.color for paint in paints] == [linear(0, 0, 0.5, 0.25), linear(1, 0, 0, 1)]
    assert [paint.alpha for paint in paints] == ["blend", "opaque"]


@pytest.mark.parametrize(
    ("statement", "file"),
    [
        ("map_Kd tex.png", "tex.png"),
        ("MAP_KD tex.png", "tex.png"),
        ("\tmap_Kd   my tex.png  ", "my tex.png"),
        ("map_Kd -s 1 1 1 -o 0 0 -bm 0.5 -type sphere my tex.png", "my tex.png"),
        ('map_Kd "my tex.png"', "my tex.png"),
        ("map_Kd TEX.PNG", "tex.png"),
        ("map_Kd C:\\work\\maps\\tex.png", "tex.png"),
        ("map_Kd /home/somebody/tex.png", "tex.png"),
        ("map_Kd maps\\Tex.png", "maps/tex.PNG"),
    ],
)
def test_images_are_found_under_the_names_that_programs_write(
    tmp_path: Path, statement: str, file: str
) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / file).write_bytes(IMAGE)
    mesh = square(tmp_path, f"newmtl m\nKd 0 0 0\n{statement}\n")
    (paint,) = mesh.looks.paints
    assert paint.image.source == tmp_path / file
    assert paint.color == (1, 1, 1, 1)
    np.testing.assert_array_equal(mesh.corner_uv, mesh.V[mesh.F][..., :2])


def test_options_scale_move_and_clamp_the_image_and_colours_multiply_it(tmp_path: Path) -> None:
    mtl = "newmtl m\nKd 0.5 0.5 1\nmap_Kd -s 3 2 -o 0.5 0.25 0 -clamp on a.png\nmap_d b.png\n"
    mesh = square(tmp_path, mtl + "Ke 1 0 0\nnorm n.png\nPm 0.5\nPr 0.75\n")
    (paint,) = mesh.looks.paints
    uv = mesh.V[mesh.F][..., :2] * [3, 2] + [0.5, 0.25]
    np.testing.assert_allclose(mesh.corner_uv, uv)
    assert paint.wrap == ("clamp", "clamp") and paint.color == linear(0.5, 0.5, 1, 1)
    assert (paint.alpha, paint.opacity.name) == ("blend", "b.png")
    assert (paint.metallic, paint.roughness) == (0.5, 0.75)
    assert paint.emission == (1, 0, 0)
    assert mesh.looks.notes == ("not shown of its materials: normal maps",)


@pytest.mark.parametrize(
    ("opacity", "expected"),
    [("d 0.5", 0.5), ("d -halo 0.5", 0.5), ("Tr 0.25", 0.75), ("Tr 1", 1), ("d 1\nTr 1", 1)],
)
def test_opacity_and_transparency(tmp_path: Path, opacity: str, expected: float) -> None:
    (paint,) = square(tmp_path, f"newmtl m\nKd 1 1 1\n{opacity}\n").looks.paints
    assert paint.color[3] == expected


def test_several_libraries_in_a_line_and_one_with_blanks_in_its_name(tmp_path: Path) -> None:
    (tmp_path / "b.mtl").write_text("newmtl n\nKd 0 1 0\n")
    (tmp_path / "a b.mtl").write_text("newmtl m\nKd 1 0 0\n")
    looks = square(tmp_path, "", "mtllib a.mtl b.mtl\nusemtl N\n").looks
    assert looks.paints[0].color == (0, 1, 0, 1)
    looks = square(tmp_path, None, "mtllib a b.mtl\nusemtl m\n").looks
    assert looks.paints[0].color == (1, 0, 0, 1)


@pytest.mark.parametrize(
    ("mtl", "head", "said"),
    [
        (None, "mtllib gone.mtl\nusemtl m\n", ("the material library 'gone.mtl' is missing",)),
        ("newmtl n\n", "mtllib a.mtl\nusemtl m\n", ("1 material not defined: m",)),
        ("newmtl m\n", "mtllib a.mtl\nusemtl m\n", ()),
        ("newmtl m\n", "mtllib gone.mtl\nusemtl m\n", ()),  # its own name with .mtl
    ],
)
def test_lost_properties_of_materials_are_named(tmp_path: Path, mtl, head, said) -> None:
    assert square(tmp_path, mtl, head).looks.notes == said


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le"])
def test_files_in_windows_encodings_are_read(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "a.obj").write_bytes((SQUARE + FACES).encode(encoding))
    assert len(load_mesh(tmp_path / "a.obj").F) == 2


@pytest.mark.parametrize(("top", "weight"), [(1, ""), (255, ""), (1, "1.0 ")])
def test_colours_of_obj_vertices(tmp_path: Path, top: float, weight: str) -> None:
    rows = [f"v 0 0 0 {weight}{top} 0 0", f"v 1 0 0 {weight}0 {top} 0", "v 0 1 0"]
    looks = load_mesh(written(tmp_path, "a.obj", "\n".join([*rows, "f 1 2 3"]))).looks
    assert looks.colors[0].tolist() == [[1, 0, 0, 1], [0, 1, 0, 1], [1, 1, 1, 1]]


def colored_ply(
    layout: str, kind: str, colors: np.ndarray, *, of_faces: bool, names=("red", "green", "blue")
) -> bytes:
    """A box of quads with a colour for each vertex or each face."""
    code = {"uchar": "B", "ushort": "H", "float": "f"}[kind]
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[layout]
    properties = [f"property {kind} {name}" for name in names]
    header = ["ply", f"format {layout} 1.0", *["comment a long header"] * 300, "element vertex 8"]
    header += [f"property float {name}" for name in "xyz"] + properties * (not of_faces)
    header += ["element face 6", "property list uchar int vertex_indices"]
    header += [*properties * of_faces, "end_header\n"]
    rows = [("fff", [*place]) for place in CORNERS]
    rows += [("Biiii", [4, *quad]) for quad in QUADS]
    first = len(CORNERS) if of_faces else 0
    for row, color in enumerate(colors.tolist(), first):
        codes, values = rows[row]
        rows[row] = codes + code * 3, [*values, *color]
    if order:
        body = b"".join(struct.pack(order + codes, *values) for codes, values in rows)
    else:
        text = [" ".join(f"{value:g}" for value in values) for _, values in rows]
        body = ("\n".join(text) + "\n").encode()
    return "\n".join(header).encode() + body


@pytest.mark.parametrize("layout", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize(("kind", "top"), [("uchar", 255), ("ushort", 65535), ("float", 1)])
@pytest.mark.parametrize("of_faces", [True, False])
def test_colours_of_ply_files(tmp_path: Path, layout, kind, top, of_faces) -> None:
    names = (
        ("red", "green", "blue") if of_faces else ("diffuse_red", "diffuse_green", "diffuse_blue")
    )
    corner = np.array(CORNERS)
    colors = top * (np.eye(3)[np.arange(6) % 3] if of_faces else corner)
    content = colored_ply(
        layout,
        kind,
        colors.astype(float if kind == "float" else int),
        of_faces=of_faces,
        names=names,
    )
    mesh = load_mesh(written(tmp_path, "a.ply", content))
    if of_faces:
        # each face keeps its own colour: the corners of a triangle are alike
        assert (mesh.looks.colors == mesh.looks.colors[:, :1]).all()
        assert len(mesh.V) == 8
        color_of = {
            tuple(np.round(n, 6)): c
            for n, c in zip(normals(mesh), mesh.looks.colors[:, 0, :3].tolist(), strict=True)
        }
        assert len(color_of) == 6 and set(map(tuple, color_of.values())) == set(
            map(tuple, np.eye(3))
        )
    else:
        np.testing.assert_allclose(mesh.looks.colors[..., :3], mesh.V[mesh.F], atol=1e-9)


def normals(mesh: Mesh) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.V[mesh.F], 1, 0)
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def test_images_named_in_comments_of_meshlab_are_read(tmp_path: Path) -> None:
    for name in ("a b.png", "c.png"):
        (tmp_path / name).write_bytes(IMAGE)
    content = (
        "ply\nformat ascii 1.0\ncomment TextureFile a b.png\ncomment TextureFile C.png\n"
        "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 3\n"
        "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
        "property int texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
        "3 0 1 2 6 0 0 1 0 0 1 1\n3 0 1 3 6 0 0 1 0 0 1 0\n3 1 2 3 6 0 0 1 0 0 1 -1\n"
    )
    looks = load_mesh(written(tmp_path, "a.ply", content)).looks
    images = [looks.paints[number].image for number in looks.paint]
    assert [each and each.source for each in images] == [
        tmp_path / "c.png",
        tmp_path / "a b.png",
        None,
    ]


def test_strips_of_a_ply_file(tmp_path: Path) -> None:
    content = (
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 0 1 2\n"
    )
    mesh = load_mesh(written(tmp_path, "a.ply", content))
    assert mesh.area == pytest.approx(1) and (normals(mesh)[:, 2] > 0).all()


ROWS = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]


@pytest.mark.parametrize(
    "text",
    [
        "OFF # a comment\n# another\n4 2 0\n" + "\n".join(ROWS) + "\n3 0 1 2\n3 0\n2\n3\n",
        "OFF\n4\n2\n5\n" + "\n".join(ROWS) + "\n3 0 1 2 3 0 2 3\n",
        "\t OFF4 2 5\n" + " ".join(ROWS) + "\n3 0 1 2\n3 0 2 3\n",
        "4 2 5".join(["NOFF\n", "\n"])
        + "\n".join(row + " 0 0 1" for row in ROWS)
        + "\n3 0 1 2\n3 0 2 3\n",
    ],
)
def test_off_files_are_tokens_and_not_lines(tmp_path: Path, text: str) -> None:
    mesh = load_mesh(written(tmp_path, "a.off", text))
    assert mesh.area == pytest.approx(1) and mesh.looks is None


@pytest.mark.parametrize(
    ("header", "colors"),
    [("COFF", "255 0 0 255"), ("COFF", "1.0 0 0 1"), ("COFF", "255 0 0"), ("OFF", "255 0 0 255")],
)
def test_colours_of_off_vertices(tmp_path: Path, header: str, colors: str) -> None:
    rows = "\n".join(f"{row} {colors}" for row in ROWS)
    mesh = load_mesh(written(tmp_path, "a.off", f"{header}\n4 2 0\n{rows}\n3 0 1 2\n3 0 2 3\n"))
    assert (mesh.looks.colors == [1, 0, 0, 1]).all()


@pytest.mark.parametrize(
    ("opacity", "alpha"), [(255, "opaque"), (128, "blend"), (0, "opaque"), (1, "opaque")]
)
def test_colours_of_vertices_have_opacity_unless_all_are_clear(
    tmp_path: Path, opacity: int, alpha: str
) -> None:
    rows = "\n".join(f"{row} 255 0 0 {opacity}" for row in ROWS)
    mesh = load_mesh(written(tmp_path, "a.off", f"COFF\n4 2 0\n{rows}\n3 0 1 2\n3 0 2 3\n"))
    assert mesh.looks.paints[0].alpha == alpha


def test_coordinates_and_face_colours_of_off_files(tmp_path: Path) -> None:
    rows = "\n".join(f"{row} {row[:3]}" for row in ROWS)
    text = f"STOFF\n4 2 0\n{rows}\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255 128\n"
    mesh = load_mesh(written(tmp_path, "a.off", text))
    np.testing.assert_array_equal(mesh.corner_uv, mesh.V[mesh.F][..., :2])
    assert mesh.looks.colors[:, 0, :3].tolist() == [[1, 0, 0], [0, 0, 1]]


def stl(bits: list[int], comment: bytes = b"solid exported", more: bytes = b"") -> bytes:
    """A binary file of two triangles, whose comment begins as a text file does."""
    triangles = np.array(
        [[ROWS[i].split() for i in face] for face in ((0, 1, 2), (0, 2, 3))], "<f4"
    )
    body = b"".join(
        bytes(12) + corners.tobytes() + struct.pack("<H", bit)
        for corners, bit in zip(triangles, bits, strict=True)
    )
    return comment.ljust(80) + struct.pack("<I", len(bits)) + body + more


@pytest.mark.parametrize(
    ("content", "colors"),
    [
        (stl([0, 0]), None),
        (stl([0x8000 | 31 << 10, 0x8000 | 31]), [[1, 0, 0], [0, 0, 1]]),
        (stl([31, 0x8000], b"x COLOR=\x00\xff\x00\xff"), [[1, 0, 0], [0, 1, 0]]),
    ],
)
def test_colours_of_binary_stl_files(tmp_path: Path, content: bytes, colors) -> None:
    mesh = load_mesh(written(tmp_path, "a.stl", content))
    assert len(mesh.F) == 2
    found = None if mesh.looks is None else mesh.looks.colors[:, 0, :3].tolist()
    assert found == colors


def test_stl_files_that_end_early_are_refused_and_extra_bytes_are_noted(tmp_path: Path) -> None:
    late = load_mesh(written(tmp_path, "a.stl", stl([0, 0], more=b"21 bytes more, or so.")))
    assert late.notes[0] == "21 bytes behind the triangles left out" and len(late.F) == 2
    with pytest.raises(MeshError, match="ends early: 2 triangles are announced, data of 1 follow"):
        load_mesh(written(tmp_path, "a.stl", stl([0, 0], b"binary")[:-10]))
    with pytest.raises(MeshError, match="ends early: 2 corners are no whole triangles"):
        load_mesh(written(tmp_path, "a.stl", "solid\nfacet\nvertex 0 0 0\nVERTEX 1 0 0\n"))


def test_looks_follow_triangles_that_are_cut_turned_and_dropped(tmp_path: Path) -> None:
    """A triangle without area lies in a T-joint; the triangle beyond it is cut in two."""
    (tmp_path / "a.mtl").write_text("newmtl r\nKd 1 0 0\nnewmtl b\nKd 0 0 1\n")
    text = (
        "mtllib a.mtl\nv 0 0 0 0 0 0\nv 2 0 0 1 1 1\nv 1 1 0 0 0 0\nv 1 0 0 1 1 1\nv 1 -1 0 0 0 0\n"
        "usemtl r\nf 1 2 3\nusemtl b\nf 1 4 2\nf 1 4 5\nf 4 2 5\nf 4 2 5\n"
    )
    mesh = load_mesh(written(tmp_path, "a.obj", text))
    above = mesh.V[mesh.F][..., 1].max(axis=1) > 0
    color = np.array([mesh.looks.paints[number].color for number in mesh.looks.paint])
    np.testing.assert_array_equal(color[:, 0] == 1, above)
    # the colour half-way along the side that was cut, as its ends give it
    middle = (mesh.V[mesh.F][..., :2] == [1, 0]).all(axis=-1) & above[:, None]
    assert middle.sum() == 2
    np.testing.assert_allclose(mesh.looks.colors[middle][:, 0], 0.5)


def test_lids_have_the_materials_of_their_rims(tmp_path: Path) -> None:
    pytest.importorskip("pymeshfix")
    (tmp_path / "a.mtl").write_text("newmtl r\nKd 1 0 0\nnewmtl b\nKd 0 0 1\n")
    rows = [f"v {x} {y} {z} {x} {y} {z}" for x, y, z in CORNERS]
    faces = [f"f {' '.join(str(i + 1) for i in quad)}" for quad in QUADS]
    text = ["mtllib a.mtl", *rows, "usemtl r", *faces[:4], "usemtl b", faces[4]]
    mesh = load_mesh(written(tmp_path, "a.obj", "\n".join(text)), repair=True)
    assert mesh.closed and len(mesh.looks.paint) == len(mesh.F) == 12
    np.testing.assert_allclose(mesh.looks.colors[..., :3], mesh.V[mesh.F], atol=1e-12)
