"""Passes beside the frames of a video."""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.errors import VideoError
from ripple_sim.scene.scene import Scene
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import render_video


def test_every_frame_has_its_passes_whatever_the_exposures(scene: Scene, tmp_path: Path) -> None:
    options = VideoOptions(
        size=(32, 24), fps=20, duration=0.2, supersample=2, shutter=180.0, exposures=2, passes=("depth", "flow")
    )
    render_video(scene, tmp_path / "clip.mp4", options)
    files = sorted(each.name for each in (tmp_path / "clip.passes").glob("*.npz"))
    assert files == [f"passes_{frame:05d}.npz" for frame in range(4)]
    with np.load(tmp_path / "clip.passes" / "passes_00001.npz") as passes:
        assert passes["depth"].shape == (24, 32)
        assert np.abs(passes["flow"]).max() > 0  # the stone falls
    with np.load(tmp_path / "clip.passes" / "passes_00003.npz") as last:
        assert not last["flow"].any()


def test_passes_of_a_resumed_render_are_refused(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="--resume"):
        render_video(scene, tmp_path / "clip.mp4", VideoOptions(resume=True, passes=("depth",)))
