import errno
import fcntl
import json
import os

import numpy as np
import pytest
from small_batch import files, new_batch

from ripple_sim.batch import make_scene as module
from ripple_sim.batch.make_scene import make_scene
from ripple_sim.batch.report import load_batch


def test_a_scene_has_the_same_bytes_in_another_folder_and_order(unbroken, tmp_path):
    batch = new_batch(tmp_path, "heights = true\n")
    for number in (3, 1):
        outcome = make_scene(str(batch.path), number)
        assert outcome.state == "made"
        assert files(batch.scene(number)) == files(unbroken.scene(number))
        assert batch.thumbnail(number).read_bytes() == unbroken.thumbnail(number).read_bytes()
    assert files(batch.scene(3))["video.mp4"] != files(batch.scene(1))["video.mp4"]
    assert not list(batch.work.iterdir())


def test_the_files_of_a_scene_agree(unbroken):
    folder = unbroken.scene(2)
    facts = json.loads((folder / "scene.json").read_text())
    heights, positions = load_batch(unbroken.path)[2].heights()["egg"], np.load(folder / "qpos.npy")
    assert heights.shape == (4, 6, 8, 8)
    assert positions.shape == (4, 14)
    assert np.abs(heights).max() == np.float32(facts["targets"]["egg"]["height_max"])
    assert np.abs(heights).max() > 0
    rows = [line.split(",") for line in (folder / "impulses.csv").read_text().splitlines()]
    assert rows[0][:4] == ["frame", "time [s]", "geom", "other"]
    assert facts["impulse"] == pytest.approx(sum(float(row[7]) for row in rows[1:]))
    assert facts["contacts"] == len(rows) - 1 > 0
    assert {row[3] for row in rows[1:]} == {"stone", "grain"}
    assert all(float(row[1]) == pytest.approx(int(row[0]) / 20) for row in rows[1:])
    assert facts["files"].keys() == files(folder).keys() - {"scene.json"}


def test_without_a_video_the_data_are_the_same(unbroken, tmp_path):
    batch = new_batch(tmp_path, 'video = "none"\nheights = true\n')
    assert make_scene(str(batch.path), 0).state == "made"
    for name in ("heights.zarr.zip", "qpos.npy", "impulses.csv"):
        assert (batch.scene(0) / name).read_bytes() == (unbroken.scene(0) / name).read_bytes()
    assert not (batch.scene(0) / "video.mp4").exists()


def test_a_scene_that_is_there_or_being_made_is_left_alone(unbroken, tmp_path):
    assert make_scene(str(unbroken.path), 0).state == "there"
    batch = new_batch(tmp_path, 'video = "none"\n')
    work = batch.work / "000000"
    work.mkdir()
    other = os.open(work, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    assert make_scene(str(batch.path), 0).state == "busy"
    os.close(other)  # as when it dies
    (work / "scene.json").write_text("from a worker that died")
    assert make_scene(str(batch.path), 0).state == "made"
    assert json.loads((batch.scene(0) / "scene.json").read_text())["files"].keys() == {"impulses.csv", "qpos.npy"}


@pytest.mark.parametrize(
    ("error", "state"), [(ValueError("broken"), "failed"), (OSError(errno.ENOSPC, "No space left"), "full")]
)
def test_a_failure_leaves_nothing_behind_and_says_why(tmp_path, monkeypatch, error, state):
    batch = new_batch(tmp_path, 'video = "none"\n')

    def fail(*_):
        (batch.work / "000001" / "half").write_text("")
        raise error

    monkeypatch.setattr(module, "render_scene", fail)
    outcome = make_scene(str(batch.path), 1)
    assert outcome.state == state
    assert str(error) in outcome.error
    assert "Traceback" in outcome.log
    assert not list((batch.work / "000001").iterdir())
    assert batch.finished() == set()
