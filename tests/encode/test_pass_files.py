"""Files of passes: what is in them, and what they replace."""

import json
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.encode.images import PassFiles, check_passes
from ripple_sim.errors import VideoError

DEPTH = np.linspace(1, 2, 12, dtype=np.float32).reshape(3, 4)
PASSES = {"depth": DEPTH, "flow": np.stack([DEPTH, -DEPTH], axis=-1), "segmentation": np.ones((3, 4), np.uint32)}


def test_npz_files_hold_the_passes_bit_for_bit_and_are_the_same_each_time(tmp_path: Path) -> None:
    contents = []
    for _ in range(2):
        files = PassFiles(tmp_path / "clip.mp4", "npz", {0: "background", 1: "floor"})
        files.write(7, PASSES)
        path = tmp_path / "clip.passes" / "passes_00007.npz"
        contents.append(path.read_bytes())
    with np.load(path) as found:
        assert all(np.array_equal(found[name], values) for name, values in PASSES.items())
    assert contents[0] == contents[1]
    geoms = json.loads((tmp_path / "clip.passes" / "segmentation.json").read_text())["geoms"]
    assert geoms == {"0": "background", "1": "floor"}


def test_exr_files_hold_the_passes_as_channels(tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    PassFiles(tmp_path / "frames", "exr", {}).write(0, PASSES)
    path = tmp_path / "frames.passes" / "passes_00000.exr"
    channels = openexr.File(str(path), separate_channels=True).channels()
    assert set(channels) == {"depth", "flow.X", "flow.Y", "segmentation"}
    assert np.array_equal(channels["flow.Y"].pixels, -DEPTH)
    assert channels["segmentation"].pixels.dtype == np.uint32
    check_passes(tmp_path / "frames", ("depth",), "exr", overwrite=False)


def test_unknown_passes_and_foreign_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="depth, normal, segmentation, flow, position, height"):
        check_passes(tmp_path / "clip.mp4", ("colour",), "npz", overwrite=False)
    with pytest.raises(VideoError, match="'npz' or 'exr'"):
        check_passes(tmp_path / "clip.mp4", ("depth",), "png", overwrite=False)
    PassFiles(tmp_path / "clip.mp4", "npz", {}).write(0, PASSES)
    check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=False)
    foreign = tmp_path / "clip.passes" / "passes_00001.npz"
    foreign.write_bytes(b"mine")
    with pytest.raises(VideoError, match="other files"):
        check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=False)
    check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=True)
    foreign.rename(foreign.with_name("thesis.txt"))
    with pytest.raises(VideoError, match=r"thesis\.txt"):
        check_passes(tmp_path / "clip.mp4", ("depth",), "npz", overwrite=True)
