"""What cannot fit into memory is refused before it is begun, in a message that names how much, and which limit."""

import contextlib
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import (
    AtlasError,
    HeightMap,
    Mesh,
    RippleError,
    SolverError,
    WaveSolver,
    build_atlas,
    sphere_atlas,
)
from ripple_sim.solver.files import require_memory, rooms


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


def tetrahedron() -> Mesh:
    return Mesh.from_arrays(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))


def test_an_atlas_that_cannot_fit_is_refused_at_once() -> None:
    said = r"resolution 2048 takes 5\.03 GB of memory, but the limit of the address space \(ulimit -v, .* leaves 0\.06"
    mesh = tetrahedron()
    with address_space(64_000_000):
        for make in (lambda: build_atlas(mesh, 2048), lambda: sphere_atlas(resolution=2048)):
            with pytest.raises(AtlasError, match=f"{said} GB; take a lower resolution, or allow more"):
                make()


def test_waves_and_height_maps_that_cannot_fit_are_refused() -> None:
    atlas = sphere_atlas(resolution=240)
    with address_space(35_000_000):
        with pytest.raises(SolverError, match=r"a wave solver of 345,600 texels takes 0\.10 GB .* lower resolution"):
            WaveSolver(atlas, backend="cpu")
        with pytest.raises(SolverError, match=r"the height map of 345,600 texels takes 0\.04 GB"):
            HeightMap(atlas.texels)


def test_frames_that_cannot_fit_are_refused(opengl: None) -> None:
    import mujoco

    from ripple_sim.render import Renderer
    from ripple_sim.solver.gl import shared_context

    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    gl = shared_context()
    if gl.software:
        with (
            address_space(64_000_000),
            pytest.raises(RippleError, match=r"frames of 4096x4096 pixels takes 1\.48 GB .* take smaller frames"),
        ):
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
    for name, text in {"proc/meminfo": "MemAvailable: 3000000 kB\nSwapFree: 0 kB\n", **files}.items():
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
        assert (least.left, least.by) == (3_072_000_000, "the machine's free memory")
    else:
        assert (least.left, least.by) == (200_000_000, "the memory limit of the cgroup (1.00 GB)")


def test_where_nothing_is_known_nothing_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(rooms(tmp_path)) == []
    monkeypatch.setattr("ripple_sim.solver.files.rooms", lambda: iter(()))
    require_memory(SolverError, 1e15, "this", "do that")


def test_what_is_small_costs_no_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ripple_sim.solver.files.rooms", lambda: pytest.fail("looked"))
    require_memory(SolverError, 1e6, "this", "do that")
