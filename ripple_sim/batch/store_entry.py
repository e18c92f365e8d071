"""`[store]` of a plan: what is kept of each scene."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Literal

import msgspec

from ripple_sim.errors import SceneError
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.settings import check_options

Video = Literal["mp4", "webm", "gif", "webp", "png", "exr", "none"]


class StoreEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[store]`: what is kept of each scene."""

    video: Video = "mp4"
    """`mp4`, `webm`, `gif`, `webp`; `png` or `exr`: a folder of frames; `none`: nothing is drawn."""
    size: tuple[int, int] = (256, 256)
    """Of the frames [pixels]."""
    fps: int = 24
    """Frames per second."""
    duration: float | None = None
    """Length of each scene [s]; by default the scene's."""
    supersample: int = 1
    """Frames are drawn this many times as wide and high, and averaged."""
    resolution: int | None = None
    """Texels along the edge of a chart; by default the scene's."""
    backend: Literal["cpu", "gl", "auto"] = "cpu"
    """Where waves are computed. The same numbers on every machine come from `cpu` alone."""
    overlay: list[str] | None = None
    """Drawn on the video; by default the scene's."""
    passes: list[str] = []
    """Passes of every frame: depth, normal, segmentation, flow, position, height."""
    pass_format: Literal["npz", "exr"] = "npz"
    """Format of the passes."""
    impulses: bool = True
    """`impulses.csv`: every contact's impulse and place, step by step."""
    heights: bool = False
    """`heights.zarr.zip`: the height of each target at every frame."""
    positions: bool = True
    """`qpos.npy`: MuJoCo's generalised positions at every frame, float64 [frames, nq]."""
    format: Literal["folders", "webdataset"] = "folders"
    """A folder a scene, or tar files of many scenes each."""
    scenes_per_tar: int = 100
    """How many scenes a tar file holds."""


def video_name(store: StoreEntry) -> str | None:
    """Name of a scene's video or folder of frames, or None if nothing is drawn."""
    return {"none": None, "png": "frames", "exr": "frames"}.get(store.video, f"video.{store.video}")


def options_of(store: StoreEntry) -> VideoOptions:
    """How the scenes of a batch are rendered."""
    return VideoOptions(
        size=store.size,
        fps=store.fps,
        duration=store.duration,
        supersample=store.supersample,
        resolution=store.resolution,
        backend=store.backend,
        overlay=store.overlay,
        passes=store.passes,
        pass_format=store.pass_format,
        frame_format="exr" if store.video == "exr" else "png",
    )


def check_store(store: StoreEntry) -> None:
    """Make sure that scenes can be kept in this way, before one is made.

    Raises
    ------
    RippleError
        Naming what is invalid, or the package that is missing.
    """
    if store.passes and store.video == "none":
        raise SceneError("plan: store.passes need frames, and store.video is 'none'; name a video, or leave passes out")
    if store.heights and importlib.util.find_spec("zarr") is None:
        raise SceneError("plan: store.heights needs the package zarr; install it with: pip install 'ripple-sim[zarr]'")
    with tempfile.TemporaryDirectory(prefix="ripple-sim-plan-") as folder:
        check_options(options_of(store), Path(folder) / (video_name(store) or "frames"))
