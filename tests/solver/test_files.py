"""Too large a request is refused early; files are complete or absent; image limits."""

import contextlib
import os
import resource
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ripple_sim.scene import check_files, image_pixels, load_image
from ripple_sim.solver import (
    AtlasError,
    HeightMap,
    Mesh,
    RippleError,
    SolverError,
    WaveSolver,
    load_mesh,
    sphere_atlas,
)
from ripple_sim.solver.files import atomic_write
from ripple_sim.solver.images import read_image
from ripple_sim.solver.layouts import build_atlas
from ripple_sim.solver.memory import require_memory, rooms
from ripple_sim.solver.mesh.looks import ImageSource
from ripple_sim.solver.texels import texture_map


@contextlib.contextmanager
def address_space(more: int) -> Iterator[None]:
    """So many bytes more than the process has now."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + more, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def test_an_atlas_that_cannot_fit_is_refused_at_once() -> None:
    said = (
        r"resolution 2048 takes 5\.03 GB of memory, but the limit of the address space "
        r"\(ulimit "
        r"-v, .* leaves 0\.06"
    )
    mesh = Mesh.from_arrays(
        np.eye(4)[:, :3], np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    )
    with address_space(64_000_000):
        for make in (lambda: build_atlas(mesh, 2048), lambda: sphere_atlas(resolution=2048)):
            with pytest.raises(
                AtlasError, match=f"{said} GB; take a lower resolution, or allow more"
            ):
                make()


def test_waves_and_height_maps_that_cannot_fit_are_refused() -> None:
    atlas = sphere_atlas(resolution=240)
    with address_space(35_000_000):
        with pytest.raises(
            SolverError, match=r"a wave solver of 345,600 texels takes 0\.10 GB .* lower resolution"
        ):
            WaveSolver(atlas, backend="cpu")
        with pytest.raises(SolverError, match=r"the height map of 345,600 texels takes 0\.04 GB"):
            HeightMap(atlas.texels)


def test_frames_that_cannot_fit_are_refused(opengl: None) -> None:
    import mujoco

    from ripple_sim.render import Renderer
    from ripple_sim.solver.gl import shared_context

    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"
    )
    gl = shared_context()
    if gl.software:
        message = r"frames of 4096x4096 pixels takes 1\.48 GB .* take smaller frames"
        with address_space(64_000_000), pytest.raises(RippleError, match=message):
            Renderer(gl, model, {}, size=(4096, 4096))


def test_a_mesh_file_that_cannot_fit_is_refused(tmp_path: Path) -> None:
    from ripple_sim.solver import MeshError, load_mesh

    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.truncate(10**12)  # a hole: no disk is taken
    with pytest.raises(MeshError, match=r"huge\.stl.* takes 3000\.00 GB of memory"):
        load_mesh(path)


def machine(root: Path, **files: str) -> Path:
    """A folder like that of a machine's root, with some of the files that tell of memory."""
    for name, text in {
        "proc/meminfo": "MemAvailable: 3000000 kB\nSwapFree: 0 kB\n",
        **files,
    }.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


CGROUPS = {
    "version 2": {
        "proc/self/cgroup": "0::/a/b\n",
        "sys/fs/cgroup/a/memory.max": "1000000000\n",
        "sys/fs/cgroup/a/memory.current": "900000000\n",
        "sys/fs/cgroup/a/memory.stat": "anon 5\ninactive_file 100000000\n",
        "sys/fs/cgroup/a/b/memory.max": "max\n",
    },
    "version 1": {
        "proc/self/cgroup": "3:cpu:/\n2:memory:/docker/x\n",
        "sys/fs/cgroup/memory/memory.limit_in_bytes": "1000000000\n",
        "sys/fs/cgroup/memory/memory.usage_in_bytes": "800000000\n",
    },
    "none": {},
}


@pytest.mark.parametrize("version", CGROUPS)
def test_the_limits_of_cgroups_and_of_those_above_count(version: str, tmp_path: Path) -> None:
    least = min(rooms(machine(tmp_path, **CGROUPS[version])))
    if version == "none":
        assert least == (3_072_000_000, "the machine's free memory")
    else:
        assert least == (200_000_000, "the memory limit of the cgroup (1.00 GB)")


def test_nothing_is_refused_if_the_free_memory_is_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert list(rooms(tmp_path)) == []
    monkeypatch.setattr("ripple_sim.solver.memory.rooms", lambda: iter(()))
    require_memory(SolverError, 1e15, "this", "do that")


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_a_file_appears_at_the_end_and_nothing_else_stays(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folders" / "a.bin"
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(b"whole")
        assert not path.exists()
        # on the same file system, so that renaming is one step
        assert unfinished.parent == path.parent
    assert path.read_bytes() == b"whole"
    assert names(path.parent) == ["a.bin"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_old_file_stays_as_it_was_where_writing_fails(
    tmp_path: Path, error: type[BaseException]
) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def write() -> None:
        with atomic_write(path) as unfinished:
            unfinished.write_bytes(b"half of the n")
            raise error

    with pytest.raises(error):
        write()
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.bin"]


@pytest.mark.parametrize("kind", ["folder", "pipe"])
def test_special_files_are_refused_and_left_alone(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "taken"
    path.mkdir() if kind == "folder" else os.mkfifo(path)
    with pytest.raises(FileExistsError, match="not a regular file"), atomic_write(path):
        pytest.fail("nothing may be written")
    assert names(tmp_path) == ["taken"]
    assert not path.is_file()


def test_nothing_written_is_an_error_and_no_empty_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "a.bin"):
        pass
    assert names(tmp_path) == []


def png(width: int, height: int) -> bytes:
    """A file of a few hundred bytes that says it has so many pixels."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b"")]
    packed = [
        struct.pack(f">I4s{len(x)}sI", len(x), kind, x, zlib.crc32(kind + x)) for kind, x in chunks
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def with_coordinates() -> Any:
    atlas = sphere_atlas(resolution=4)
    object.__setattr__(atlas.mesh, "corner_uv", np.zeros((len(atlas.mesh.F), 3, 2)))
    return atlas


def model(path: Path) -> Path:
    xml = path.with_name("model.xml")
    xml.write_text(
        f'<mujoco><asset><texture name="t" type="2d" file="{path.name}"/></asset></mujoco>'
    )
    return xml


READERS: dict[str, Callable[[Path], object]] = {
    "texture of the command line": load_image,
    "map of a material": lambda path: texture_map(with_coordinates(), path, 0.0, 1.0),
    "texture of a model": lambda path: check_files(model(path)),
    "image of a material": lambda path: image_pixels(ImageSource(path, path.name)),
    "image in a GLB": lambda path: image_pixels(ImageSource(path.read_bytes(), path.name)),
    "image of a look": lambda path: read_image(
        RippleError, path, "texture image", lambda mode: "RGB"
    ),
}


@pytest.mark.parametrize("reader", READERS)
def test_a_decompression_bomb_is_refused_wherever_images_are_read(
    reader: str, tmp_path: Path
) -> None:
    (tmp_path / "bomb.png").write_bytes(png(20_000, 20_000))
    message = r"cannot be read: Image size \(400000000 pixels\) exceeds limit of 178956970"
    with pytest.raises(RippleError, match=message):
        READERS[reader](tmp_path / "bomb.png")


def test_a_jpeg_beyond_the_limit_is_read_at_a_smaller_scale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "large.jpg"
    slope = np.linspace(0, 255, 400)[None, :, None]
    image = Image.fromarray(np.broadcast_to(slope, (200, 400, 3)).astype(np.uint8))
    image.save(path)
    # twice as many are the limit: a quarter of each side
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 3000)
    pixels = load_image(path)
    assert pixels.shape == (50, 100, 3)
    np.testing.assert_allclose(pixels[25, :, 0], slope.reshape(100, 4).mean(axis=1), atol=2)
    for refused, options in (("large.jpg", {"progressive": True}), ("large.png", {})):
        image.save(tmp_path / refused, **options)
        with pytest.raises(
            RippleError, match=r"80000 pixels\) exceeds limit of 6000 .* JPEG \(baseline\)"
        ):
            load_image(tmp_path / refused)


def test_an_image_that_does_not_fit_into_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ripple_sim.solver import memory

    (tmp_path / "large.png").write_bytes(png(10_000, 10_000))
    monkeypatch.setattr(memory, "rooms", lambda: iter([(5e8, "a small machine")]))
    with pytest.raises(
        SolverError, match=r"large\.png' of 10000x10000 pixels takes 1\.20 GB .* leaves 0\.50"
    ):
        read_image(SolverError, tmp_path / "large.png", "image", lambda mode: "RGB")


@pytest.mark.parametrize("ending", ["zip", "bz2"])
def test_archives_are_not_unpacked(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"ball.{ending}"
    path.write_bytes(b"PK\x03\x04")
    with pytest.raises(RippleError, match=r"unknown ending: .* unpacked"):
        load_mesh(path)
