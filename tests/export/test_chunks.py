"""Runs divided over files, which a root layer joins, and which continue after a kill."""

import dataclasses
import json
import resource
import signal
from pathlib import Path

import numpy as np
import pytest
from programs import PROGRAMS, ended
from unfinished_videos import interrupting_at

from ripple_sim import ExportOptions, RippleError, Scene, Simulation, export_scene

pytest.importorskip("pxr")
from pxr import Usd, UsdGeom, UsdValidation

# 11 frames: three chunks, the last of which is short
SETTINGS = {"fps": 250, "duration": 0.044, "tessellation": "own", "chunk": 4}
OPTIONS = ExportOptions(**SETTINGS)
SURFACE = "/World/bodies/nest/egg"
STONE = "/World/bodies/stone"
ATTRIBUTES = ("GetPointsAttr", "GetNormalsAttr", "GetVelocitiesAttr", "GetExtentAttr")


@pytest.fixture(scope="module")
def whole(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "run.usdc"
    export_scene(scene, path, dataclasses.replace(OPTIONS, chunk=None))
    return path


def sampled(path: Path, time: float) -> list[np.ndarray]:
    stage = Usd.Stage.Open(str(path))
    stone, surface = (stage.GetPrimAtPath(each) for each in (STONE, SURFACE))
    mesh = UsdGeom.Mesh(surface)
    frames = [np.array(getattr(mesh, name)().Get(time), dtype=float) for name in ATTRIBUTES]
    return frames + [
        np.array(UsdGeom.Xformable(each).ComputeLocalToWorldTransform(time))
        for each in (stone, surface)
    ]


def files(path: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in path.with_name("run.chunks").iterdir()}


@pytest.mark.parametrize("name", ["run.usdc", "run.usda"])
def test_chunks_hold_the_run_also_between_their_frames(
    scene: Scene, whole: Path, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    assert export_scene(scene, path, OPTIONS).frames == 11
    assert {each.name for each in tmp_path.iterdir()} == {name, "run.chunks", "run.textures"}
    parts = [f"frames_{part}.usdc" for part in ("00000-00003", "00004-00007", "00008-00010")]
    assert set(files(path)) == {*parts, "manifest.usdc"}
    stage = Usd.Stage.Open(str(path))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 10)
    for time in (0, 2, 3, 3.5, 4, 7.25, 8, 10):
        for found, expected in zip(sampled(path, time), sampled(whole, time), strict=True):
            assert np.abs(found - expected).max() < 1e-6 * 0.6
    assert np.abs(sampled(path, 10)[0] - sampled(path, 0)[0]).max() > 1e-5  # it moves
    registry = UsdValidation.ValidationRegistry()
    errors = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)
    assert [error.GetErrorAsString() for error in errors] == []


def test_a_killed_export_continues_to_the_same_files(
    scene: Scene, scene_file: Path, tmp_path: Path
) -> None:
    export_scene(scene, path := tmp_path / "once" / "run.usdc", OPTIONS)
    again = tmp_path / "again" / "run.usdc"
    program = PROGRAMS / "export_until_killed.py"
    killed = ended(program, scene_file, again, json.dumps(SETTINGS), "10")
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    kept = sorted((again.with_name("run.usdc.part") / "frames").glob("frames_*"))
    assert [each.name for each in kept] == ["frames_00000-00003.usdc", "frames_00004-00007.usdc"]
    times = [each.stat().st_mtime_ns for each in kept]
    with pytest.raises(RippleError, match="the frames in a chunk was 4 and now is 5"):
        export_scene(scene, again, dataclasses.replace(OPTIONS, chunk=5, resume=True))
    export_scene(scene, again, dataclasses.replace(OPTIONS, resume=True))
    assert files(again) == files(path)
    assert [
        (again.with_name("run.chunks") / each.name).stat().st_mtime_ns for each in kept
    ] == times
    assert not again.with_name("run.usdc.part").exists()
    for time in (0, 3.5, 7, 9.5):
        assert all(map(np.array_equal, sampled(again, time), sampled(path, time)))


def test_an_interrupted_export_names_the_kept_files(scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "run.usdc"
    with pytest.raises(KeyboardInterrupt) as caught:
        export_scene(scene, path, OPTIONS, progress=interrupting_at(6))
    assert "4 frames are kept" in caught.value.__notes__[0]
    assert [each.name for each in tmp_path.iterdir()] == ["run.usdc.part"]

    def change(simulation: Simulation) -> None:
        simulation.data.qvel[0] += 0.1

    with pytest.raises(RippleError, match="not in the state"):
        export_scene(scene, path, dataclasses.replace(OPTIONS, resume=True), on_step=change)
    (path.with_name("run.usdc.part") / "frames" / "frames_00000-00003.usdc").write_bytes(b"")
    with pytest.raises(
        RippleError, match=r"run\.usdc: frames_00000-00003\.usdc is damaged; leave --resume out"
    ):
        export_scene(scene, path, dataclasses.replace(OPTIONS, resume=True))
    assert export_scene(scene, path, OPTIONS).frames == 11


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("run.usdz", {}, r"chunk is only for \.usdc, \.usda, not"),
        ("run.html", {}, r"chunk is only for \.usdc, \.usda, not"),
        ("run.usdc", {"chunk": 0}, "chunk must be a whole number, 1 or greater, got 0"),
        ("run.usdc", {"chunk": None, "resume": True}, "add --chunk"),
    ],
)
def test_invalid_options_are_refused_before_the_simulation(
    scene, tmp_path, name: str, options: dict, message: str
):
    with pytest.raises(RippleError, match=message):
        export_scene(scene, tmp_path / name, dataclasses.replace(OPTIONS, **options))
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_one_error_and_complete_files_stay(scene: Scene, tmp_path: Path) -> None:
    """USD ends the process if a stage lets go of a layer whose file could not be written."""
    path = tmp_path / "run.usdc"
    export_scene(scene, tmp_path / "once" / "run.usdc", OPTIONS)
    one_chunk = max(each.stat().st_size for each in (tmp_path / "once" / "run.chunks").iterdir())
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for limit in (one_chunk // 8, one_chunk - 1):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
        try:
            with pytest.raises(RippleError, match=r"cannot write .*run\.usdc: .*File too large"):
                export_scene(scene, path, OPTIONS)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert not path.exists()
    assert export_scene(scene, path, dataclasses.replace(OPTIONS, resume=True)).frames == 11
    assert files(path) == files(tmp_path / "once" / "run.usdc")
