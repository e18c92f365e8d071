import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pyarrow.parquet
import pytest
from small_batch import PLAN, Here, files, new_batch, small_plan

from ripple_sim.batch import (
    BatchFolder,
    DaskExecutor,
    Outcome,
    RunOptions,
    make_scene,
    run,
    run_batch,
    status_text,
)
from ripple_sim.batch.folder import Failure, load_stored
from ripple_sim.cli.main import main
from ripple_sim.errors import BatchError, SceneError

DATA = 'video = "none"\nheights = true\n'


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(run, "LocalExecutor", Here)
    monkeypatch.setattr(run, "_POLL_INTERVAL", 0.01)


def same_scenes(batch, reference, numbers=range(5)):
    """Whether these scenes, and no others, have the data of a reference."""
    assert batch.finished() == set(numbers)
    for number in numbers:
        for name in ("heights.zarr.zip", "qpos.npy", "impulses.csv"):
            assert (batch.scene(number) / name).read_bytes() == (
                reference.scene(number) / name
            ).read_bytes()


@pytest.mark.parametrize("name", ["index.html", "failed", "work/000000", "failed/000000.log"])
def test_links_in_its_folder_are_not_followed(here, tmp_path, name):
    plan = small_plan(tmp_path, DATA)
    folder = tmp_path / "out"
    mine = tmp_path / "mine"
    run_batch(plan, folder, RunOptions(shard=(2, 2), limit=1))
    mine.write_text("mine")
    path = folder / name
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    path.symlink_to(mine)
    with pytest.raises(BatchError, match=f"{name} is a link"):
        run_batch(plan, folder)
    assert mine.read_text() == "mine"


def test_shards_and_limits_share_out_the_scenes(here, unbroken, tmp_path):
    plan = small_plan(tmp_path, DATA)
    folder = tmp_path / "out"
    batch = BatchFolder(folder)
    assert run_batch(plan, folder, RunOptions(shard=(2, 2), limit=1)).made == 1
    assert batch.finished() == {1}
    assert run_batch(plan, folder, RunOptions(shard=(2, 2))).made == 1
    assert batch.finished() == {1, 3}
    assert run_batch(plan, folder, RunOptions(shard=(1, 2))).made == 3
    same_scenes(batch, unbroken)
    times = {path: path.stat().st_mtime_ns for path in batch.scenes.rglob("*")}
    assert run_batch(None, folder).made == 0
    assert {path: path.stat().st_mtime_ns for path in batch.scenes.rglob("*")} == times
    assert "5 of 5 scenes finished, 0 put aside" in status_text(folder)


def test_the_index_has_a_row_a_scene(here, tmp_path):
    run_batch(small_plan(tmp_path, DATA), tmp_path / "out", RunOptions(limit=2))
    (tmp_path / "out" / "index.parquet").unlink()
    run_batch(None, tmp_path / "out", RunOptions(limit=1))
    table = pyarrow.parquet.read_table(tmp_path / "out" / "index.parquet").to_pylist()
    assert [row["number"] for row in table] == [0, 1, 2]
    assert all(
        row["status"] == "finished" and row["seconds"] > 0 and len(row["hash"]) == 32
        for row in table
    )
    assert len({row["camera.azimuth"] for row in table}) == 3
    page = (tmp_path / "out" / "index.html").read_text()
    assert page.count("scenes/00000") == 3


def test_a_scene_that_fails_three_times_is_put_aside_and_can_be_tried_again(
    here, tmp_path, monkeypatch
):
    tried = []

    def make(folder, number):
        tried.append(number)
        if number == 1 and len(tried) < 20:
            return Outcome(number, "failed", error="stone too soft", log="Traceback of it")
        return make_scene(folder, number)

    monkeypatch.setattr(run, "make_scene", make)
    folder = tmp_path / "out"
    progress = run_batch(small_plan(tmp_path, DATA), folder)
    assert (progress.made, progress.aside, progress.failures) == (4, 1, 1)
    assert tried.count(1) == 3
    assert (folder / "failed" / "000001.log").read_text().count("Traceback of it") == 3
    assert "scene 1 failed 3 times: stone too soft" in status_text(folder)
    row = pyarrow.parquet.read_table(folder / "index.parquet").to_pylist()[1]
    assert (row["status"], row["error"]) == ("failed", "stone too soft")
    run_batch(None, folder)
    assert tried.count(1) == 3
    tried += [0] * 20
    assert run_batch(None, folder, RunOptions(retry_failed=True)).made == 1
    assert "5 of 5 scenes finished, 0 put aside" in status_text(folder)
    assert not list((folder / "failed").iterdir())


def test_a_scene_whose_worker_dies_is_tried_nine_times(here, tmp_path, monkeypatch):
    tried = []

    def die(folder, number):
        tried.append(number)
        raise RuntimeError("terminated abruptly")

    monkeypatch.setattr(run, "make_scene", die)
    plan = small_plan(tmp_path, DATA, PLAN.replace("count = 5", "count = 1"))
    assert run_batch(plan, tmp_path / "out").aside == 1
    assert len(tried) == 9
    assert "its worker died: terminated abruptly" in status_text(tmp_path / "out")


def test_a_batch_waits_for_a_scene_that_another_process_makes(here, tmp_path, monkeypatch):
    answers = iter(["busy", "busy", "there"])
    monkeypatch.setattr(run, "make_scene", lambda folder, number: Outcome(number, next(answers)))
    plan = small_plan(tmp_path, DATA, PLAN.replace("count = 5", "count = 1"))
    progress = run_batch(plan, tmp_path / "out")
    assert (progress.made, progress.finished) == (0, 1)
    assert next(answers, None) is None


def test_a_full_disk_stops_the_batch_and_counts_as_no_failure(here, tmp_path, monkeypatch):
    plan = small_plan(tmp_path, DATA)
    with pytest.raises(
        BatchError, match="GB left, less than the 1e\\+06 GB to be kept free; make room"
    ):
        run_batch(plan, tmp_path / "out", RunOptions(keep_free=1e15))
    monkeypatch.setattr(
        run, "make_scene", lambda folder, number: Outcome(number, "full", error="No space left")
    )
    with pytest.raises(BatchError, match="the disk is full: No space left"):
        run_batch(plan, tmp_path / "out")
    assert BatchFolder(tmp_path / "out").failures() == {}


@pytest.mark.parametrize("name", ["keep_plan", "write_index"])
def test_a_full_disk_is_reported_for_the_batchs_own_files(
    name, here, tmp_path, monkeypatch, capsys
):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(run, name, full)
    monkeypatch.setattr(
        run, "make_scene", lambda folder, number: Outcome(number, "full", error="No space left")
    )
    small_plan(tmp_path, DATA)
    assert main(["batch", str(tmp_path / "plan.toml"), "-o", str(tmp_path / "out")]) == 1
    assert "the disk is full: No space left on device; make room" in capsys.readouterr().err


def test_a_changed_plan_is_refused_with_its_changes(tmp_path):
    new_batch(tmp_path)
    for old, new, message in (
        ("seed = 3", "seed = 4", "plan.seed was 3 and is 4"),
        ("[0, 360]", "[0, 90]", "plan.vary.camera.azimuth was .*360"),
        ("fps = 20", "fps = 25", "plan.store.fps was 20 and is 25"),
    ):
        with pytest.raises(BatchError, match=message):
            run_batch(small_plan(tmp_path, text=PLAN.replace(old, new)), tmp_path / "out")
    plan = small_plan(tmp_path)
    (tmp_path / "scene.xml").write_text(
        (tmp_path / "scene.xml").read_text().replace("0.25", "0.24")
    )
    with pytest.raises(
        BatchError, match=r"files.scene.toml was .* take it back, or name another folder"
    ):
        run_batch(plan, tmp_path / "out")


def test_files_that_are_not_utf8_count_as_damaged(tmp_path):
    batch = new_batch(tmp_path)
    batch.note_failure(0, Failure(errors=1, error="it fell"), "log")
    for path, word in ((batch.plan, b"scene"), (batch.failed / "000000.json", b"fell")):
        path.write_bytes(path.read_bytes().replace(word, word[:2] + b"\xef", 1))
    assert batch.failures() == {}
    with pytest.raises(BatchError, match="it is the plan of a batch and must stay as it is"):
        load_stored(batch.plan)


def test_an_unknown_key_is_refused_before_the_first_scene(tmp_path):
    with pytest.raises(SceneError, match=r"no geom\[stoone\]"):
        run_batch(
            small_plan(tmp_path, text=PLAN.replace("geom[stone]", "geom[stoone]")), tmp_path / "out"
        )
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "letters.txt").write_text("")
    with pytest.raises(BatchError, match="holds other files"):
        run_batch(small_plan(tmp_path), tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["letters.txt"]


def workers_of(parent: int) -> list[int]:
    """Processes that make scenes for a batch."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(path.read_text().rsplit(")", 1)[1].split()[1]) == parent:
                line = (path.parent / "cmdline").read_bytes()
                found += [int(path.parent.name)] if b"spawn_main" in line else []
        except (OSError, ValueError):
            continue
    return found


def wait_for(condition):
    for _ in range(6000):
        if result := condition():
            return result
        time.sleep(0.05)
    raise AssertionError("nothing happened for five minutes")


def test_killed_workers_and_a_killed_parent_lose_and_change_nothing(unbroken, tmp_path):
    small_plan(tmp_path, "heights = true\n")
    folder = tmp_path / "out"
    batch = BatchFolder(folder)
    command = [
        sys.executable,
        "-m",
        "ripple_sim",
        "batch",
        str(tmp_path / "plan.toml"),
        "-o",
        str(folder),
    ]
    command += ["--workers", "1", "--keep-free", "0.001"]
    parent = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        wait_for(lambda: len(batch.finished()) >= 1)
        worker = wait_for(lambda: workers_of(parent.pid))[0]
        os.kill(worker, signal.SIGKILL)
        replaced = wait_for(lambda: [each for each in workers_of(parent.pid) if each != worker])[0]
        wait_for(lambda: list(batch.work.glob("0*")))
    finally:
        parent.kill()
        parent.wait()
    wait_for(lambda: not Path(f"/proc/{replaced}").exists())
    before = {number: files(batch.scene(number)) for number in batch.finished()}
    shutil.rmtree(batch.failed)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    assert batch.finished() == set(range(5))
    for number in range(5):
        assert files(batch.scene(number)) == files(unbroken.scene(number))
    assert all(files(batch.scene(number)) == kept for number, kept in before.items())
    assert not list(batch.work.glob("0*"))


def test_tar_files_are_packed_as_they_fill_up(here, tmp_path):
    plan = small_plan(tmp_path, 'video = "none"\nformat = "webdataset"\nscenes_per_tar = 2\n')
    batch = BatchFolder(tmp_path / "out")
    run_batch(plan, tmp_path / "out", RunOptions(limit=3))
    assert ([tar.name for tar in batch.tar_files()], batch.loose()) == (["000000.tar"], {2})
    run_batch(None, tmp_path / "out")
    assert [tar.name for tar in batch.tar_files()] == ["000000.tar", "000002.tar", "000004.tar"]
    assert not batch.loose() and batch.finished() == set(range(5))
    rows = pyarrow.parquet.read_table(batch.index).to_pylist()
    assert [row["number"] for row in rows] == list(range(5))
    assert all(row["status"] == "finished" and row["seconds"] > 0 for row in rows)


def test_a_dask_cluster_makes_the_same_scenes(unbroken, tmp_path):
    from distributed import LocalCluster

    plan = small_plan(tmp_path, DATA)
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "protocol": "tcp"}
    with LocalCluster(**options, dashboard_address=None) as cluster:
        assert (
            run_batch(plan, tmp_path / "out", RunOptions(dask=cluster.scheduler_address)).made == 5
        )
    same_scenes(BatchFolder(tmp_path / "out"), unbroken)


def test_a_scheduler_that_does_not_answer_is_named(tmp_path, monkeypatch):
    import distributed

    def refuse(*_, **__):
        raise OSError("timed out")

    monkeypatch.setattr(distributed, "Client", refuse)
    with pytest.raises(
        BatchError, match=r"no Dask scheduler answers at 'tcp://nowhere:1' \(timed out\)"
    ):
        run_batch(small_plan(tmp_path, DATA), tmp_path / "out", RunOptions(dask="tcp://nowhere:1"))


def test_a_dask_scheduler_that_is_gone_is_one_line(tmp_path, monkeypatch, capsys) -> None:
    """Dask says "ConnectionPool closing.", after a line in its log."""

    class Lost(DaskExecutor):
        places = 1

        def __init__(self, address: str) -> None:
            self._address = address
            self._client = SimpleNamespace(status="closed")

        def submit(self, *_: object, **__: object) -> Future:
            raise RuntimeError("ConnectionPool closing.")

        def shutdown(self, *_: object, **__: object) -> None:
            pass

    monkeypatch.setattr("ripple_sim.batch.run.DaskExecutor", Lost)
    (tmp_path / "plan.toml").write_text(
        'count = 2\nscenes = ["sphere"]\n[store]\nresolution = 8\nduration = 0.1\n'
    )
    assert (
        main(
            [
                "batch",
                str(tmp_path / "plan.toml"),
                "-o",
                str(tmp_path / "out"),
                "--dask",
                "tcp://host:1",
            ]
        )
        == 1
    )
    error = capsys.readouterr().err
    assert "the Dask scheduler at tcp://host:1 is gone; finished scenes are kept" in error
    assert "ConnectionPool" not in error and error.count("\n") == 1
