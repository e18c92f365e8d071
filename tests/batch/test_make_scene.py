"""Scenes of a batch are the same bytes in any order and in every container."""

import errno
import json
import pickle
import tarfile

import numpy as np
import pytest
from small_batch import PLAN, files, new_batch, small_plan

from ripple_sim import load_batch
from ripple_sim.batch import in_shard, make_scene, pack, worker as module
from ripple_sim.encode.locks import locked
from ripple_sim.errors import BatchError


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
    heights = load_batch(unbroken.path)[2].heights()["egg"]
    positions = np.load(folder / "qpos.npy")
    assert (heights.shape, positions.shape) == ((4, 6, 8, 8), (4, 14))
    assert np.abs(heights).max() == np.float32(facts["targets"]["egg"]["height_max"]) > 0
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


def test_finished_scenes_and_scenes_in_the_making_are_not_made_again(unbroken, tmp_path):
    assert make_scene(str(unbroken.path), 0).state == "there"
    batch = new_batch(tmp_path, 'video = "none"\n')
    work = batch.work / "000000"
    work.mkdir()
    with locked(batch.work / "000000.lock"):
        assert make_scene(str(batch.path), 0).state == "busy"
    (batch.work / "000000.lock").touch()  # of a worker that died
    (work / "scene.json").write_text("from a worker that died")
    assert make_scene(str(batch.path), 0).state == "made"
    assert json.loads((batch.scene(0) / "scene.json").read_text())["files"].keys() == {
        "impulses.csv",
        "qpos.npy",
    }


@pytest.mark.parametrize(
    ("error", "state"), [(ValueError("bad"), "failed"), (OSError(errno.ENOSPC, "full"), "full")]
)
def test_a_failed_scene_leaves_nothing_but_its_reason(tmp_path, monkeypatch, error, state):
    batch = new_batch(tmp_path, 'video = "none"\n')

    def fail(*_):
        (batch.work / "000001" / "half").write_text("")
        raise error

    monkeypatch.setattr(module, "render_scene", fail)
    outcome = make_scene(str(batch.path), 1)
    assert outcome.state == state
    assert str(error) in outcome.error and "Traceback" in outcome.log
    assert not list((batch.work / "000001").iterdir()) and not batch.finished()


PACKED = 'heights = true\nformat = "webdataset"\nscenes_per_tar = 3\npasses = ["depth", "flow"]\n'


@pytest.fixture(scope="module")
def packed(opengl, tmp_path_factory):
    """Scenes 0 to 3, of which the first three are in a tar file."""
    batch = new_batch(tmp_path_factory.mktemp("packed"), PACKED)
    for number in (2, 0, 1, 3):
        assert make_scene(str(batch.path), number).state == "made"
    pack(batch, 0, 3)
    return batch


def test_scenes_read_the_same_from_folders_and_tar_files(packed, unbroken):
    loose = load_batch(unbroken.path)
    batch = load_batch(packed.path)
    assert (loose.numbers, batch.numbers) == ([0, 1, 2, 3, 4], [0, 1, 2, 3])
    assert packed.finished() == {0, 1, 2, 3}
    assert packed.loose() == {3}
    for one, other in zip(loose, batch, strict=False):
        assert one.read("video.mp4") == other.read("video.mp4")
        assert np.array_equal(one.heights()["egg"], other.heights()["egg"])
        assert np.array_equal(one.positions(), other.positions())
        assert np.array_equal(one.impulses(), other.impulses())
        assert one.facts()["values"] == other.facts()["values"]
        assert other.times()["seconds"] > 0


def test_frames_and_passes_are_read_from_a_tar_file(packed):
    scene = load_batch(packed.path)[1]
    frames = list(scene.frames())
    assert [frame.shape for frame in frames] == [(48, 64, 3)] * 4
    assert frames[0].std() > 5
    passes = list(scene.passes())
    assert len(passes) == 4
    assert (passes[0]["depth"].shape, passes[0]["flow"].shape) == ((48, 64), (48, 64, 2))
    with pytest.raises(BatchError, match=r"has no file 'clip\.mp4'; it has "):
        scene.read("clip.mp4")


def test_a_tar_file_has_the_same_bytes_if_its_scenes_are_packed_one_by_one(packed, tmp_path):
    batch = new_batch(tmp_path, PACKED)
    for numbers in ((1,), (0, 2)):  # as after --retry-failed
        for number in numbers:
            make_scene(str(batch.path), number)
        pack(batch, 0, 3)
    assert batch.tar(0).read_bytes() == packed.tar(0).read_bytes()
    assert not batch.loose()
    assert make_scene(str(batch.path), 1).state == "there"
    with tarfile.open(batch.tar(0)) as file:
        names = file.getnames()
    scenes = [name.split(".")[0] for name in names]
    assert scenes == sorted(scenes)
    of_one_scene = {"scene.json", "video.mp4", "video.passes.passes_00002.npz"}
    assert {f"000001.{name}" for name in of_one_scene} <= set(names)


def test_no_scene_is_stored_twice_after_a_kill_during_packing(packed, tmp_path, monkeypatch):
    batch = new_batch(tmp_path, PACKED)
    for number in range(3):
        make_scene(str(batch.path), number)
    kept = {number: files(batch.scene(number)) for number in range(3)}
    with monkeypatch.context() as patch:
        patch.setattr("pathlib.Path.rename", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            pack(batch, 0, 3)
    assert {number: files(batch.scene(number)) for number in range(3)} == kept
    assert load_batch(batch.path).numbers == [0, 1, 2]
    pack(batch, 0, 3)
    assert batch.tar(0).read_bytes() == packed.tar(0).read_bytes()


def test_a_loaded_batch_goes_to_other_processes(unbroken):
    batch = pickle.loads(pickle.dumps(load_batch(unbroken.path)))
    assert [scene.number for scene in batch] == [0, 1, 2, 3, 4]
    assert batch[4].facts()["number"] == 4


def test_shards_keep_the_scenes_of_a_tar_file_together(tmp_path):
    plan = small_plan(tmp_path, PACKED, PLAN.replace("count = 5", "count = 20"))
    shards = [
        [number for number in range(20) if in_shard(number, plan, (part, 3))] for part in (1, 2, 3)
    ]
    assert sorted(number for shard in shards for number in shard) == list(range(20))
    assert shards[1] == [3, 4, 5, 12, 13, 14]
