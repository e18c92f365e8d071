"""OBJ and OFF files: polygons, seams, indices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mesh_text import CORNERS, QUADS, obj, off, written

from ripple_sim.solver import load_mesh


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
    assert mesh.notes == ()


def test_negative_indices_count_back_from_their_own_line(tmp_path: Path) -> None:
    text = "".join(obj([CORNERS[i] for i in quad], []) + "f -4 -3 -2 -1\n" for quad in QUADS)
    mesh = load_mesh(written(tmp_path, "relative.obj", text))
    assert (len(mesh.V), mesh.volume) == (8, pytest.approx(1))


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
