"""Damaged caches are rebuilt; damaged output is mended or refused; other files stay."""

import contextlib
import dataclasses
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import trimesh
from fuzzing import DAMAGES, changed, command, damage, fuzzed, fuzzed_by, home_of_others, outcome
from hypothesis import assume, given, strategies as st
from small_batch import PLAN, Here, small_plan, write_files
from unfinished_videos import interrupting_at

from ripple_sim.batch import BatchFolder, RunOptions, load_batch, run, run_batch
from ripple_sim.batch.folder import Failure
from ripple_sim.cli import main as cli, render
from ripple_sim.encode.formats import FORMATS
from ripple_sim.errors import RippleError
from ripple_sim.solver import Atlas, Mesh, build_atlas, load_atlas
from ripple_sim.solver.cache import cache_folder
from ripple_sim.solver.kernel import kernel

BALL = trimesh.creation.icosphere(subdivisions=1)
BALLS = [Mesh.from_arrays(size * BALL.vertices, BALL.faces) for size in (1, 2)]


def atlases() -> list[Atlas]:
    return [build_atlas(ball, 4, layout=layout) for ball in BALLS for layout in ("cube", "patches")]


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache of four atlases."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        atlases()
        return cache_folder()


@fuzzed_by(25)
@given(DAMAGES)
def test_damaged_atlases_in_the_cache_are_made_anew_and_damaged_files_refused(
    cache: Path, damages: list
) -> None:
    whole = [load_atlas(file) for file in sorted(cache.iterdir())]
    with home_of_others() as home, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(home))
        shutil.copytree(cache, home / "ripple-sim")
        damage(home / "ripple-sim", damages)
        for file in (home / "ripple-sim").glob("*.npz"):
            found = outcome(lambda file=file: load_atlas(file))
            assert isinstance(found, RippleError) or any(
                np.array_equal(found.areas, each.areas) for each in whole
            )
        assert {each.areas.tobytes() for each in atlases()} == {
            each.areas.tobytes() for each in whole
        }


CACHES = [kernel(function)._cache for function in (lambda x: x + 1, changed, damage)]


@fuzzed
@given(DAMAGES)
def test_damaged_kernels_are_not_loaded(damages: list) -> None:
    """What is not loaded is compiled: tests/solver/test_kernel.py."""
    with home_of_others() as home, pytest.MonkeyPatch.context() as patch:
        patch.setattr("ripple_sim.solver.kernel_cache.kernel_folder", lambda: home / "kernels")
        for number, cache in enumerate(CACHES):
            cache.save("key", bytes([number]) * 99)
        damage(home / "kernels", damages)
        for number, cache in enumerate(CACHES):
            assert cache.load("key") in (None, bytes([number]) * 99)
            cache.save("key", b"new")


STORES = {
    "plain": 'video = "png"\npasses = ["depth"]\nheights = true\n',
    "tars": 'video = "none"\nformat = "webdataset"\nscenes_per_tar = 1\n',
}


@pytest.fixture(scope="module")
def batches(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folders of batches of two scenes, of which one is made, and the other has failed once."""
    home = tmp_path_factory.mktemp("batches")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "LocalExecutor", Here)
        for name, more in STORES.items():
            text = PLAN.replace("count = 5", "count = 2").replace("[64, 48]", "[16, 16]")
            run_batch(small_plan(home, more, text), home / name, RunOptions(limit=1, keep_free=0))
            batch = BatchFolder(home / name)
            batch.note_failure(1, Failure(errors=1, error="it fell"), "log")
            (batch.work / "000001").mkdir()
            (batch.work / "000001" / "qpos.npy").write_text("half")
        yield home


def read_all(folder: Path) -> None:
    scenes = outcome(lambda: load_batch(folder))
    for scene in () if isinstance(scenes, RippleError) else scenes:
        for read in (
            scene.names,
            scene.facts,
            scene.times,
            scene.positions,
            scene.heights,
            scene.impulses,
        ):
            outcome(read)
        for many in (scene.frames, scene.passes):
            outcome(lambda many=many: list(many()))


@fuzzed_by(25)
@given(
    st.sampled_from(sorted(STORES)), DAMAGES, st.sampled_from(["", "--status", "--retry-failed"])
)
def test_a_damaged_batch_continues_or_is_refused(
    batches: Path, name: str, damages: list, flag: str
) -> None:
    with home_of_others() as home:
        shutil.copytree(batches / name, home / "out")
        damage(home / "out", damages)
        read_all(home / "out")
        command("batch", home / "out", *flag.split(), "--keep-free", 0.01)
        read_all(home / "out")


COMMON = ("--fps", 40, "--duration", 0.1, "--size", "32x32", "--backend", "cpu")


class Job(NamedTuple):
    command: str
    output: str
    options: tuple[Any, ...] = ()
    can_resume: bool = False

    def words(self, *more: str) -> list[Any]:
        return [self.command, "scene.toml", "-o", self.output, *self.options, *COMMON, *more]


JOBS = {
    "frames": Job("render", "out/frames", ("--passes", "depth,height"), can_resume=True),
    "mp4": Job("render", "out/film.mp4", ("--passes", "depth"), can_resume=True),
    "webp": Job("render", "out/film.webp", can_resume=True),
    "gif": Job("render", "out/film.gif", ("--passes", "height"), can_resume=True),
    "usda": Job("export", "out/run.usda", ("--chunk", 1), can_resume=True),
    "zarr": Job("export", "out/run.zarr"),
    "html": Job("export", "out/run.html"),
    "parquet": Job("export", "out/run.parquet"),
}


@pytest.fixture(scope="module")
def outputs(opengl: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folders with the output of each job, whole and as an interrupt leaves it."""
    home = tmp_path_factory.mktemp("outputs")
    write_files(home)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        for ending in (".mp4", ".gif"):
            patch.setitem(FORMATS, ending, dataclasses.replace(FORMATS[ending], length=2))
        for name, job in JOBS.items():
            assert command(*job.words()) == 0
            (home / "out").rename(home / f"{name} whole")
            with pytest.MonkeyPatch.context() as interrupted:
                interrupted.setattr(
                    render, "frame_progress", lambda *_: contextlib.nullcontext(interrupting_at(3))
                )
                assert cli.main([*map(str, job.words())]) == 130
            (home / "out").mkdir(exist_ok=True)
            (home / "out").rename(home / f"{name} half")
        yield home


@fuzzed_by(25)
@given(
    st.sampled_from(sorted(JOBS)),
    st.sampled_from(["whole", "half"]),
    DAMAGES,
    st.sampled_from(["", "--overwrite"]),
)
def test_damaged_outputs_are_replaced_or_refused(
    outputs: Path, name: str, state: str, damages: list, flag: str
):
    # --overwrite replaces the file to which a link leads
    assume(not flag or all(kind != "link" for _, kind, _ in damages))
    job = JOBS[name]
    options = flag.split()
    if state == "half" and job.can_resume:
        options.append("--resume")
    with home_of_others() as home, pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        write_files(home)
        shutil.copytree(outputs / f"{name} {state}", home / "out")
        damage(home / "out", damages)
        if command(*job.words(*options)) == 0:
            assert (home / job.output).exists()
            assert not list(home.rglob("*.part"))
