"""What `ripple-sim info` reports, and says where OpenGL does not run, or not on the GPU."""

import grp
import importlib.metadata
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path

import mujoco
import pytest
from programs import ended

from ripple_sim import diagnostics
from ripple_sim.cli import main as cli
from ripple_sim.diagnostics import find_drawing_threads, find_problems
from ripple_sim.solver.backends import auto_backend
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import context as gl, creation
from ripple_sim.video import settings

NOBODY = 65534
pytestmark = pytest.mark.usefixtures("opengl")  # tests take OpenGL away, so it must be there


def info(**environment: str) -> dict:
    """Report of a process with other environment variables."""
    return json.loads(
        ended(
            "-m", "ripple_sim", "info", "--json", env={**os.environ, **environment}, check=True
        ).stdout
    )


@pytest.fixture
def devices(tmp_path: Path) -> Path:
    """A folder of device files with a render node."""
    (tmp_path / "dri").mkdir()
    (tmp_path / "dri" / "renderD128").touch()
    return tmp_path


@pytest.fixture
def plain_user(tmp_path: Path) -> Iterator[None]:
    """For root everything is permitted: be nobody for a while."""
    root = os.geteuid() == 0
    if root:
        # up to the folder of the user's tests; a process among several has one of its own below
        for folder in (
            tmp_path,
            *list(tmp_path.parents)[: 3 if "PYTEST_XDIST_WORKER" in os.environ else 2],
        ):
            folder.chmod(0o755)
        os.seteuid(NOBODY)
    yield
    if root:
        os.seteuid(0)


def test_a_missing_vendor_file_is_reported_with_the_package(tmp_path: Path) -> None:
    report = info(__EGL_VENDOR_LIBRARY_DIRS=str(tmp_path))
    assert report["opengl"] is None
    assert f"there is no EGL vendor file (*.json) in {tmp_path}" in report["advice"]
    assert "apt-get install libegl-mesa0" in report["advice"]


def test_a_damaged_vendor_file_and_its_missing_library_are_reported(tmp_path, monkeypatch) -> None:
    file = tmp_path / "10_nvidia.json"
    gone = "libEGL_nvidia_gone.so.0"
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    lost = f"names {gone}, which cannot be loaded: apt-get install libnvidia-gl-"
    for text, said in (("{", "is damaged"), (f'{{"ICD": {{"library_path": "{gone}"}}}}', lost)):
        file.write_text(text)
        [finding] = find_problems(None, tmp_path)
        assert f"{file} {said}" in finding


def test_a_broken_library_is_reported_with_the_package(tmp_path: Path) -> None:
    library = "libGL.so.1"
    # found before the real one, and no library
    (tmp_path / library).write_bytes(b"\x7fELF nothing")
    report = info(LD_LIBRARY_PATH=str(tmp_path))
    assert report["opengl"] is None
    assert f"the library {library} cannot be loaded" in report["advice"]
    assert "apt-get install --reinstall libgl1" in report["advice"]


def test_a_missing_library_is_reported_with_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ripple_sim.diagnostics._LIBRARIES", {"libEGL-gone.so.1": "libegl1"})
    [finding] = find_problems(None)
    assert finding == "the library libEGL-gone.so.1 is missing: apt-get install libegl1"


def test_software_rendering_is_reported_if_there_is_no_gpu(tmp_path: Path) -> None:
    [finding] = find_problems(True, tmp_path)
    assert "OpenGL runs in software" in finding and "there is no GPU" in finding


def test_missing_permission_on_the_render_node_is_reported_with_its_group(
    devices: Path, plain_user: None
) -> None:
    node = devices / "dri" / "renderD128"
    mode = node.stat().st_mode & 0o777
    group_of_node = node.stat().st_gid
    assert mode & 0o006 != 0o006  # the umask has kept others out
    if os.geteuid() != NOBODY:
        node.chmod(0)
    for software in (True, None):
        [finding] = find_problems(software, devices)
        assert finding.startswith(
            f"this user has no access to the GPU's render node {node}: sudo usermod -aG "
        )
        assert f" {grp.getgrgid(group_of_node).gr_name} $USER" in finding


def test_an_nvidia_gpu_without_its_egl_library_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "nvidia0").touch()
    (tmp_path / "version").write_text(
        "NVRM version: NVIDIA UNIX x86_64 Kernel Module  550.54.15  Tue Mar 5\n"
    )
    monkeypatch.setattr("ripple_sim.diagnostics._NVIDIA_VERSION", tmp_path / "version")
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    (tmp_path / "50_mesa.json").write_text('{"ICD": {"library_path": "libEGL_mesa.so.0"}}')
    [finding] = find_problems(True, tmp_path)
    assert "no EGL vendor file of its driver" in finding
    assert "apt-get install libnvidia-gl-550" in finding
    assert "NVIDIA_DRIVER_CAPABILITIES=all" in finding
    (tmp_path / "10_nvidia.json").write_text('{"ICD": {"library_path": "libEGL_nvidia.so.0"}}')
    assert find_problems(True, tmp_path) == []


def test_no_finding_on_a_gpu(devices: Path) -> None:
    assert find_problems(False, devices) == []


@pytest.mark.parametrize(
    ("threads", "renderer", "count"),
    [
        (None, "llvmpipe (LLVM 15.0.7, 256 bits)", 0),
        ("0", "llvmpipe (LLVM 15.0.7, 256 bits)", 0),
        ("1", "llvmpipe (LLVM 15.0.7, 256 bits)", 1),
        ("8", "NVIDIA H200/PCIe/SSE2", 0),
    ],
)
def test_threads_that_the_user_gives_llvmpipe_are_named(
    monkeypatch, threads, renderer, count
) -> None:
    if threads is None:
        monkeypatch.delenv("LP_NUM_THREADS", raising=False)
    else:
        monkeypatch.setenv("LP_NUM_THREADS", threads)
    problems = find_drawing_threads(renderer)
    assert len(problems) == count
    assert all(f"LP_NUM_THREADS={threads}" in each and "set it to 0" in each for each in problems)


def report(capsys) -> dict:
    assert cli.main(["info", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_info_names_versions_driver_and_the_backend_that_auto_takes(capsys):
    got = report(capsys)
    assert all(got["versions"].values())
    assert {"ripple-sim", "python", "mujoco", "numpy", "numba", "moderngl", "av"} <= set(
        got["versions"]
    )
    context = gl.shared_context()
    assert got["opengl"]["renderer"] == context.renderer
    assert got["opengl"]["software"] is context.software
    assert got["backend"] == ("cpu" if context.software else "gl") == auto_backend()


def test_info_without_egl_names_the_packages_to_install(capsys, monkeypatch):
    """Every EGL library is missing, as on a machine without Mesa."""
    monkeypatch.setattr(gl, "_shared", {})
    monkeypatch.setattr(
        creation, "_LIBRARIES", ({"libegl": "libEGL-missing.so", "libgl": "libGL-missing.so"},)
    )
    with pytest.raises(GLError):
        gl.shared_context()
    got = report(capsys)
    assert (got["opengl"], got["backend"]) == (None, "cpu")
    assert "libegl1" in got["advice"]
    assert cli.main(["info"]) == 0
    assert re.search(
        r"none: rendering is impossible[\s\S]*apt-get install", capsys.readouterr().out
    )


def test_mujocos_version_is_right_with_the_package_mujoco_core(monkeypatch):
    installed = importlib.metadata.version

    def without_mujoco(name: str) -> str:
        return installed("no such package" if name == "mujoco" else name)

    monkeypatch.setattr(importlib.metadata, "version", without_mujoco)
    monkeypatch.setattr(settings, "version", without_mujoco)
    assert diagnostics.collect()["versions"]["mujoco"] == mujoco.__version__
    assert settings.versions.__wrapped__()["mujoco"] == mujoco.__version__


def test_a_missing_package_is_reported(monkeypatch):
    monkeypatch.setattr(diagnostics, "PACKAGES", ("ripple-sim", "no-such-package"))
    got = diagnostics.collect()
    assert got["versions"]["no-such-package"] is None
    assert "not installed" in diagnostics.as_text(got)
