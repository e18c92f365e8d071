"""Images beyond pillow's limit are refused wherever one is read, and the message names the limit."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from ripple_sim.scene.drop import load_image, mesh_image
from ripple_sim.scene.load_scene import check_files
from ripple_sim.solver import RippleError, SolverError, load_mesh, sphere_atlas
from ripple_sim.solver.files import read_image
from ripple_sim.solver.texels.maps import texture_map


def png(width: int, height: int) -> bytes:
    """A file of a few hundred bytes that says it has so many pixels."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b"")]
    packed = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def glb(path: Path, image: bytes) -> Path:
    """A ball whose image is replaced by another file of the same length."""
    ball = trimesh.creation.icosphere(subdivisions=0)
    small = path.with_name("small.png")
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)).save(small)
    with Image.open(small) as texture:
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=texture)
        ball.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(ball.vertices), 2)), material=material)
        content = ball.export(file_type="glb")
    begin = content.index(b"\x89PNG")
    path.write_bytes(content[:begin] + image + content[begin + len(image) :])
    return path


def with_coordinates() -> Any:
    atlas = sphere_atlas(resolution=4)
    object.__setattr__(atlas.mesh, "corner_uv", np.zeros((len(atlas.mesh.F), 3, 2)))
    return atlas


def model(path: Path) -> Path:
    xml = path.with_name("model.xml")
    xml.write_text(f'<mujoco><asset><texture name="t" type="2d" file="{path.name}"/></asset></mujoco>')
    return xml


READERS: dict[str, Callable[[Path], object]] = {
    "texture of the command line": load_image,
    "map of a material": lambda path: texture_map(with_coordinates(), path, 0.0, 1.0),
    "texture of a model": lambda path: check_files(model(path)),
    "image in a GLB": lambda path: mesh_image(glb(path.with_name("ball.glb"), path.read_bytes())),
    "image of a look": lambda path: read_image(RippleError, path, "texture image", lambda mode: "RGB"),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_decompression_bomb_is_refused_wherever_images_are_read(reader: str, tmp_path: Path) -> None:
    (tmp_path / "bomb.png").write_bytes(png(20_000, 20_000))
    with pytest.raises(
        RippleError, match=r"cannot be read: Image size \(400000000 pixels\) exceeds limit of 178956970"
    ):
        READERS[reader](tmp_path / "bomb.png")


def test_an_image_that_does_not_fit_into_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ripple_sim.solver import files

    (tmp_path / "large.png").write_bytes(png(10_000, 10_000))
    monkeypatch.setattr(files, "rooms", lambda: iter([files.Room(5e8, "a small machine")]))
    with pytest.raises(SolverError, match=r"large\.png' of 10000x10000 pixels takes 1\.20 GB .* leaves 0\.50"):
        read_image(SolverError, tmp_path / "large.png", "image", lambda mode: "RGB")


@pytest.mark.parametrize("ending", ["zip", "bz2"])
def test_archives_are_not_unpacked(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"ball.{ending}"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(RippleError, match=r"unknown ending; valid are .* unpacked"):
        load_mesh(path)
