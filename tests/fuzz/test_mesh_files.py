"""Damaged mesh files are read and painted, or refused in one line."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from fuzzing import (
    CHANGES,
    VALUES,
    changed,
    fuzzed_by,
    home_of_others,
    outcome,
    places,
    put,
)
from gltf_files import SQUARE_UV, Gltf
from hypothesis import given, strategies as st

from ripple_sim.errors import RippleError
from ripple_sim.scene.paint import painting_of
from ripple_sim.solver import Mesh, load_mesh

MTL = b"newmtl m\nKd 1 0.5 0\nd 0.5\nmap_Kd -s 2 2 -o 0.5 0 a b.png\nmap_d -clamp on m.png\n"
OBJ = (
    b"mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nusemtl m\nf 1/1 2/2 3\n"
)
PLY = (
    b"ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\n"
    b"property float y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
    b"property uchar blue\nelement face 1\nproperty list uchar int vertex_indices\n"
    b"property list uchar float texcoord\nproperty int texnumber\nend_header\n"
    b"0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2 6 0 0 1 0 0 1 0\n"
)
OFF = b"STCOFF\n3 1 0\n0 0 0 1 0 0 1 0 0\n1 0 0 0 1 0 1 1 0\n0 1 0 0 0 1 1 0 1\n3 0 1 2 255 0 0\n"
STL = b"x COLOR=abcd".ljust(80) + b"\1\0\0\0" + np.arange(12, dtype="<f4").tobytes() + b"\1\2"


def gltf() -> Gltf:
    """A file with a picture, a skin, a morph target, a sparse accessor and instances."""
    file = Gltf()
    texture = file.texture([[[255, 0, 0, 100], [0, 0, 255, 255]]], wrapS=33648)
    change = {"KHR_texture_transform": {"scale": [2, 2], "rotation": 1.0}}
    look = {"baseColorTexture": {"index": texture, "extensions": change}}
    material = file.add("materials", alphaMode="BLEND", pbrMetallicRoughness=look)
    lift = file.accessor(np.ones((4, 3), np.float32))
    primitive = file.primitive(
        TEXCOORD_0=file.accessor(SQUARE_UV),
        COLOR_0=file.accessor(np.full((4, 4), 99, np.uint8)),
        JOINTS_0=file.accessor(np.zeros((4, 4), np.uint8)),
        WEIGHTS_0=file.accessor(np.full((4, 4), 64, np.uint8)),
        material=material,
        targets=[{"POSITION": lift}],
    )
    skin = file.add("skins", joints=[0])
    file.show(primitive, mesh={"weights": [0.5]}, skin=skin)
    moves = file.accessor(np.eye(3, dtype=np.float32))
    instances = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves}}}
    file.show(file.primitive(mode=5), extensions=instances, matrix=np.eye(4).ravel().tolist())
    return file


def read_and_paint(path: Path) -> None:
    mesh = outcome(lambda: load_mesh(path))
    if isinstance(mesh, Mesh) and mesh.looks is not None and mesh.looks.paints:
        painting = painting_of(mesh, mesh.looks)
        assert np.isfinite(painting.uv).all() and painting.uv.shape == (len(mesh.F), 3, 2)
    else:
        assert isinstance(mesh, Mesh | RippleError)


@pytest.mark.parametrize("name", ["a.obj", "a.mtl", "a.ply", "a.off", "a.stl", "a.glb"])
@fuzzed_by(25)
@given(CHANGES)
def test_files_with_damaged_bytes(name: str, changes: list) -> None:
    with home_of_others() as home:
        gltf().write(home / "a.glb")
        files = {"a.obj": OBJ, "a.mtl": MTL, "a.ply": PLY, "a.off": OFF, "a.stl": STL}
        for each, content in files.items():
            (home / each).write_bytes(content)
        (home / name).write_bytes(changed((home / name).read_bytes(), changes))
        read_and_paint(home / ("a.obj" if name == "a.mtl" else name))


PLACES = [place for place in places(gltf().root) if place]


@fuzzed_by(50)
@given(st.lists(st.tuples(st.sampled_from(PLACES), VALUES), min_size=1, max_size=3))
def test_gltf_files_with_strange_values(changes: list) -> None:
    file = gltf()
    for place, value in changes:
        with contextlib.suppress(KeyError, IndexError, TypeError):
            file.root = put(file.root, place, value)
    with home_of_others() as home:
        # some values are no JSON
        with contextlib.suppress(UnicodeEncodeError, ValueError, TypeError):
            file.write(home / "a.glb")
        if (home / "a.glb").exists():
            read_and_paint(home / "a.glb")
