"""glTF files: every kind of primitive and accessor, the pose at rest, and materials."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from gltf_files import SQUARE, SQUARE_UV, TRIANGLES, Gltf

from ripple_sim.solver import Mesh, MeshError, load_mesh

RED = [[255, 0, 0]]


def corners(mesh: Mesh) -> list[list[float]]:
    """Distinct places of a mesh's vertices, sorted."""
    return np.unique(mesh.V.round(6), axis=0).tolist()


@pytest.mark.parametrize(
    ("mode", "index"),
    [(4, [0, 1, 2, 0, 2, 3]), (5, [0, 1, 3, 2]), (6, [0, 1, 2, 3]), (4, None), (6, None)],
)
def test_lists_strips_and_fans_are_the_same_square(tmp_path: Path, mode: int, index) -> None:
    file = Gltf()
    points = SQUARE[[0, 1, 2, 0, 2, 3]] if (mode, index) == (4, None) else SQUARE
    triangles = None if index is None else np.array(index, np.uint16)
    file.show(file.primitive(points, triangles, mode))
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    assert len(mesh.F) == 2
    assert mesh.area == pytest.approx(1)
    normals = np.cross(*np.moveaxis(np.diff(mesh.V[mesh.F], axis=1), 1, 0))
    assert (normals[:, 2] > 0).all()


def test_points_and_lines_are_left_out_with_a_note(tmp_path: Path) -> None:
    file = Gltf()
    file.show(file.primitive(), *(file.primitive(5 * SQUARE, None, mode) for mode in (0, 1, 3)))
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    assert np.ptp(mesh.V, axis=0).tolist() == [1, 1, 0]
    assert "3 primitives of points or lines left out" in mesh.notes


@pytest.mark.parametrize("with_view", [True, False])
def test_sparse_accessors_replace_elements(tmp_path: Path, with_view: bool) -> None:
    file = Gltf()
    primitive = file.primitive()
    accessor = file.root["accessors"][primitive["attributes"]["POSITION"]]
    changed = np.array([2], np.uint8) if with_view else np.arange(4, dtype=np.uint8)
    values = np.array([[3, 3, 0]], np.float32) if with_view else 2 * SQUARE
    accessor["sparse"] = {
        "count": len(changed),
        "indices": {"bufferView": file.view(changed.tobytes()), "componentType": 5121},
        "values": {"bufferView": file.view(values.tobytes())},
    }
    if not with_view:
        del accessor["bufferView"]
    file.show(primitive)
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    assert mesh.V.max() == (3 if with_view else 2)


@pytest.mark.parametrize("kind", ["u1", "u2"])
def test_normalized_texture_coordinates_are_scaled(tmp_path: Path, kind: str) -> None:
    file = Gltf()
    stored = (SQUARE_UV * np.iinfo(kind).max).astype(kind)
    uv = file.accessor(stored, normalized=True)
    file.show(file.primitive(TEXCOORD_0=uv))
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    # a mesh counts v from the lower edge, as the square's y
    np.testing.assert_allclose(mesh.corner_uv, mesh.V[mesh.F][..., :2], atol=1e-6)


def test_interleaved_attributes_are_read(tmp_path: Path) -> None:
    file = Gltf()
    rows = np.hstack([SQUARE, SQUARE_UV]).astype(np.float32)
    view = file.view(rows.tobytes(), byteStride=20)
    both = [
        file.add(
            "accessors", bufferView=view, byteOffset=at, componentType=5126, count=4, type=name
        )
        for at, name in ((0, "VEC3"), (12, "VEC2"))
    ]
    primitive = file.primitive(TEXCOORD_0=both[1])
    primitive["attributes"]["POSITION"] = both[0]
    file.show(primitive)
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(mesh.corner_uv, mesh.V[mesh.F][..., :2], atol=1e-6)


def test_nodes_scale_mirror_and_turn(tmp_path: Path) -> None:
    file = Gltf()
    half = np.sqrt(0.5)
    child = file.show(
        file.primitive(), translation=[1, 0, 0], rotation=[0, 0, half, half], scale=[2, 1, -1]
    )
    file.root["scenes"] = [{"nodes": [file.add("nodes", children=[child], scale=[3, 3, 3])]}]
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    # (x, y) becomes (1 - y, 2 x), times 3
    assert corners(mesh) == [[0, 0, 0], [0, 6, 0], [3, 0, 0], [3, 6, 0]]
    normals = np.cross(*np.moveaxis(np.diff(mesh.V[mesh.F], axis=1), 1, 0))
    assert (normals[:, 2] < 0).all()


def test_a_skin_at_rest_moves_its_vertices_and_not_with_its_node(tmp_path: Path) -> None:
    file = Gltf()
    inverse = np.tile(np.eye(4, dtype=np.float32).ravel(), (2, 1))
    inverse[1, 12:15] = [-1, 0, 0]  # column by column
    skin = {"inverseBindMatrices": file.accessor(inverse), "joints": [0, 1]}
    file.add("nodes", translation=[0, 0, 5])
    file.add("nodes", translation=[2, 0, 5])
    joints = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]], np.uint8)
    weights = np.array([[255, 0, 0, 0]] * 4, np.uint8)
    primitive = file.primitive(JOINTS_0=file.accessor(joints))
    primitive["attributes"]["WEIGHTS_0"] = file.accessor(weights, normalized=True)
    file.show(primitive, skin=file.add("skins", **skin), translation=[100, 0, 0])
    file.root["scenes"][0]["nodes"] += [0, 1]
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    # the right side is moved by 2 - 1
    assert corners(mesh) == [[0, 0, 5], [0, 1, 5], [2, 0, 5], [2, 1, 5]]


def test_morph_targets_have_the_weights_of_the_node_or_the_mesh(tmp_path: Path) -> None:
    file = Gltf()
    lift = file.accessor(np.tile(np.array([[0, 0, 1]], np.float32), (4, 1)))
    primitive = file.primitive(targets=[{"POSITION": lift}])
    file.show(primitive, mesh={"weights": [0.25]})
    file.show(primitive, mesh={"weights": [0.25]}, weights=[2.0], translation=[2, 0, 0])
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    assert sorted({z for _, _, z in corners(mesh)}) == [0.25, 2.0]


def test_instances_are_placed(tmp_path: Path) -> None:
    file = Gltf()
    moves = file.accessor(np.array([[0, 0, 0], [3, 0, 0]], np.float32))
    instances = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}
    file.show(file.primitive(), extensions=instances)
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    assert (mesh.component_count, mesh.V[:, 0].max()) == (2, 4)


def test_transformed_and_second_texture_coordinates(tmp_path: Path) -> None:
    file = Gltf()
    change = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    material = file.add(
        "materials",
        pbrMetallicRoughness={
            "baseColorTexture": {
                "index": file.texture([RED]),
                "texCoord": 1,
                "extensions": {"KHR_texture_transform": change},
            }
        },
    )
    uv = file.accessor(SQUARE_UV)
    file.show(
        file.primitive(TEXCOORD_0=file.accessor(0 * SQUARE_UV), TEXCOORD_1=uv, material=material)
    )
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    # the lower left quarter of the image, as the extension's example says
    assert mesh.corner_uv.min() == pytest.approx(0) and mesh.corner_uv.max() == pytest.approx(0.5)
    x, y = np.moveaxis(mesh.V[mesh.F][..., :2], -1, 0)
    np.testing.assert_allclose(mesh.corner_uv, 0.5 * np.stack([1 - y, x], axis=-1), atol=1e-6)


def test_materials_and_colours_belong_to_triangles(tmp_path: Path) -> None:
    file = Gltf()
    blue = {"baseColorFactor": [0, 0, 1, 1], "metallicFactor": 0.25, "roughnessFactor": 0.5}
    material = file.add("materials", pbrMetallicRoughness=blue)
    colors = file.accessor(np.full((4, 3), 32768, np.uint16), normalized=True)
    file.show(file.primitive(material=material), file.primitive(SQUARE + 2, COLOR_0=colors))
    looks = load_mesh(file.write(tmp_path / "a.glb")).looks
    color = [looks.paints[number].color for number in looks.paint]
    assert color == [(0, 0, 1, 1)] * 2 + [(1, 1, 1, 1)] * 2
    blue_paint = looks.paints[looks.paint[0]]
    assert (blue_paint.metallic, blue_paint.roughness) == (0.25, 0.5)
    np.testing.assert_allclose(looks.colors[:2], 1)
    np.testing.assert_allclose(looks.colors[2:], [[[32768 / 65535] * 3 + [1]] * 3] * 2)


def test_emission_has_a_strength_and_the_coordinates_of_the_image(tmp_path: Path) -> None:
    file = Gltf()
    image = file.texture([[[255, 0, 0]]])
    emission = {"emissiveFactor": [1, 0.5, 0], "emissiveTexture": {"index": image, "texCoord": 1}}
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}
    base = {"baseColorTexture": {"index": image}}
    materials = [
        file.add("materials", **emission, extensions=strong),
        file.add("materials", **emission, pbrMetallicRoughness=base),
        file.add("materials", extensions={"KHR_materials_unlit": {}}),
    ]
    uv = file.accessor(SQUARE_UV)
    coordinates = {"TEXCOORD_0": uv, "TEXCOORD_1": uv}
    file.show(*(file.primitive(SQUARE + i, material=i, **coordinates) for i in materials))
    looks = load_mesh(file.write(tmp_path / "a.glb")).looks
    assert [paint.emission for paint in looks.paints] == [(1, 0.5, 0), (0, 0, 0), (0, 0, 0)]
    assert looks.paints[0].emission_image is not None and looks.paints[2].unlit
    assert looks.notes == (
        "not shown of its materials: emission with texture coordinates of its own",
    )


def test_materials_have_specular_glossiness_wrap_modes_alpha_and_notes_of_losses(
    tmp_path: Path,
) -> None:
    file = Gltf()
    texture = file.texture([RED], wrapS=33071, wrapT=33648)
    gloss = {"diffuseTexture": {"index": texture}, "diffuseFactor": [1, 1, 1, 0.5]}
    material = file.add(
        "materials",
        alphaMode="MASK",
        alphaCutoff=0.25,
        normalTexture={"index": texture},
        extensions={"KHR_materials_pbrSpecularGlossiness": gloss, "KHR_materials_clearcoat": {}},
    )
    file.show(file.primitive(TEXCOORD_0=file.accessor(SQUARE_UV), material=material))
    looks = load_mesh(file.write(tmp_path / "a.glb")).looks
    (paint,) = looks.paints
    assert (paint.wrap, paint.alpha, paint.cutoff) == (("clamp", "mirror"), "mask", 0.25)
    assert paint.color == (1, 1, 1, 0.5) and paint.image.source.startswith(b"\x89PNG")
    assert looks.notes == ("not shown of its materials: clear coats, normal maps",)


def test_data_of_uris_and_of_files_beside(tmp_path: Path) -> None:
    file = Gltf()
    file.show(file.primitive())
    for number, uri in enumerate(
        (
            "data:application/octet-stream;base64," + base64.b64encode(file.data).decode(),
            "my%20data.bin",
        )
    ):
        (tmp_path / "my data.bin").write_bytes(file.data)
        root = file.root | {"buffers": [{"uri": uri, "byteLength": len(file.data)}]}
        (tmp_path / f"{number}.gltf").write_text(json.dumps(root))
        assert len(load_mesh(tmp_path / f"{number}.gltf").F) == 2


def test_unsupported_required_extensions_are_named(tmp_path: Path) -> None:
    file = Gltf(extensionsRequired=["VENDOR_shape", "KHR_mesh_quantization"], animations=[{}])
    file.show(file.primitive())
    notes = load_mesh(file.write(tmp_path / "a.glb")).notes
    assert any("requires VENDOR_shape, which is not read" in note for note in notes)
    assert "animations ignored: it is shown at rest" in notes


def compressed(file: Gltf) -> None:
    file.root["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}


def draco(file: Gltf) -> None:
    primitive = file.root["meshes"][0]["primitives"][0]
    data = {"bufferView": file.view(b"nothing"), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": data}


def ring(file: Gltf) -> None:
    file.root["nodes"] += [{"children": [2]}, {"children": [1]}]


def old(file: Gltf) -> None:
    file.root["asset"]["version"] = "1.0"


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (compressed, r"meshopt .*undo that with npx @gltf-transform/cli copy"),
        (draco, r"Draco .*gltf-transform/cli copy"),
        (ring, r"nodes\[1\] is among its own parents"),
        (old, r"it is glTF 1.0, but must be glTF 2.0; convert it with npx gltf-pipeline"),
        (
            lambda file: file.root["accessors"][0].update(count=9),
            r"ends early: 9 elements of 12 bytes",
        ),
        (
            lambda file: file.root["accessors"][1].update(bufferView=7),
            r"bufferViews\[7\], which it",
        ),
        (lambda file: file.root["nodes"][0].update(mesh=3), r"refers to meshes\[3\]"),
        (lambda file: file.root["scenes"][0].update(nodes=[0, 0]), r"belongs to its scene twice"),
        (
            lambda file: file.root["accessors"][0].update(componentType=1),
            r"unknown component type 1",
        ),
    ],
)
def test_damaged_and_compressed_files_are_refused_in_one_line(tmp_path: Path, damage, said) -> None:
    file = Gltf()
    file.show(file.primitive())
    damage(file)
    with pytest.raises(MeshError, match=said):
        load_mesh(file.write(tmp_path / "a.glb"))


def test_draco_is_read_with_its_package(tmp_path: Path) -> None:
    DracoPy = pytest.importorskip("DracoPy")
    data = DracoPy.encode(
        SQUARE, TRIANGLES.reshape(-1, 3).astype(np.uint32), tex_coord=SQUARE_UV.astype(np.float64)
    )
    stored = DracoPy.decode(data).attributes
    kinds = {len(each["data"][0]): each["unique_id"] for each in stored}
    file = Gltf()
    primitive = file.primitive(TEXCOORD_0=file.accessor(SQUARE_UV))
    ids = {"POSITION": kinds[3], "TEXCOORD_0": kinds[2]}
    primitive["extensions"] = {
        "KHR_draco_mesh_compression": {"bufferView": file.view(data), "attributes": ids}
    }
    file.show(primitive)
    mesh = load_mesh(file.write(tmp_path / "a.glb"))
    assert mesh.area == pytest.approx(1, abs=1e-3)
    np.testing.assert_allclose(mesh.corner_uv, mesh.V[mesh.F][..., :2], atol=1e-3)
