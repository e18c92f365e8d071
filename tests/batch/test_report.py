import pickle
import tarfile

import numpy as np
import pytest
from small_batch import PLAN, files, new_batch, small_plan

from ripple_sim import load_batch
from ripple_sim.batch.finished import pack
from ripple_sim.batch.make_scene import make_scene
from ripple_sim.batch.run import in_shard
from ripple_sim.errors import BatchError

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
    loose, batch = load_batch(unbroken.path), load_batch(packed.path)
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


def test_what_is_read_fits_together(packed):
    scene = load_batch(packed.path)[1]
    facts, impulses = scene.facts(), scene.impulses()
    assert len(impulses) == facts["contacts"] > 0
    assert impulses["impulse"].sum() == pytest.approx(facts["impulse"])
    assert set(impulses["other"]) <= {"stone", "grain"}
    frames = list(scene.frames())
    assert [frame.shape for frame in frames] == [(48, 64, 3)] * 4
    assert frames[0].std() > 5
    passes = list(scene.passes())
    assert len(passes) == 4
    assert {name: array.shape for name, array in passes[0].items()}.items() >= {
        "depth": (48, 64),
        "flow": (48, 64, 2),
    }.items()
    with pytest.raises(BatchError, match=r"has no file 'clip\.mp4'; it has "):
        scene.read("clip.mp4")


def test_a_tar_file_has_the_same_bytes_in_whatever_steps_it_is_packed(packed, tmp_path):
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
    samples = [name.split(".")[0] for name in names]
    assert samples == sorted(samples)
    assert {"000001.video.mp4", "000001.scene.json", "000001.video.passes.passes_00002.npz"} <= set(names)


def test_a_kill_between_tar_file_and_folders_doubles_nothing(packed, tmp_path, monkeypatch):
    batch = new_batch(tmp_path, PACKED)
    for number in range(3):
        make_scene(str(batch.path), number)
    kept = {number: files(batch.scene(number)) for number in range(3)}
    with monkeypatch.context() as patch:
        patch.setattr("ripple_sim.batch.finished._remove_whole", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
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


def test_what_is_no_batch_is_refused(tmp_path):
    with pytest.raises(BatchError, match=r"not the folder of a batch: it has no plan.json"):
        load_batch(tmp_path)


def test_shards_keep_the_scenes_of_a_tar_file_together(tmp_path):
    plan = small_plan(tmp_path, PACKED, PLAN.replace("count = 5", "count = 20"))
    shards = [[number for number in range(20) if in_shard(number, plan, (part, 3))] for part in (1, 2, 3)]
    assert sorted(number for shard in shards for number in shard) == list(range(20))
    assert shards[1] == [3, 4, 5, 12, 13, 14]
