"""The frames of a long run in files of their own: value clips of USD, which a root layer joins."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from pxr import Sdf, Tf, Usd, Vt

from ripple_sim.capture.snapshot import state_digest
from ripple_sim.encode.part import Part
from ripple_sim.encode.replace import MARK
from ripple_sim.solver.files import final_path

from .source import Chunking, Moment, Source


def save(layer: Sdf.Layer) -> None:
    """Write a layer to its file.

    Raises
    ------
    OSError
    """
    succeed(layer.Save)


def succeed(work: Callable[..., bool], *arguments: object) -> None:
    """Do what says whether it could write, and raise OSError if it could not."""
    try:
        if work(*arguments):
            return
        reason = "it could not be written"
    except Tf.ErrorException as error:
        text = " ".join(str(error).split())
        reason = first[1] if (first := re.search(r"line \d+ in file \S+ : '(.*?)'(?= Error in |$)", text)) else text
    raise OSError(reason)


_CHECKED = 16  # at least every so many frames the simulation's state is fingerprinted, to be compared on resuming
_MANIFEST = "manifest.usdc"


class Chunks:
    """Takes time samples into layers of some frames each, which wait in a folder until the run is complete.

    A layer has the first frame of the next one, too, so that readers interpolate between the two. What is the same at
    all times belongs in the stage's root layer.

    Parameters
    ----------
    stage : Usd.Stage
    path : Sdf.Path
        Prim under which everything lies that has time samples.
    chunking : Chunking

    Raises
    ------
    VideoError
        If another process writes to the same place, or a run that is to be resumed has other settings.
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, chunking: Chunking) -> None:
        self._stage, self._path, self._chunking = stage, path, chunking
        self._part: Part | None = Part(
            final_path(chunking.output),
            suffix=".usdc",
            length=chunking.frames,
            settings=chunking.settings or {},
            resume=chunking.resume,
            overwrite=True,
        )
        self.stored = self._part.frames
        self._layer: Sdf.Layer | None = None
        self._waiting = 0  # frames of the open layer

    def write(self, number: int, write: Callable[[], None]) -> None:
        """Write a frame, by a function that sets its samples."""
        if self._layer is not None and self._waiting == self._chunking.frames:
            self._sample(write)
            self._end()
        if self._layer is None:
            self._begin()
        self._sample(write)
        self._waiting += 1

    def check_state(self, source: Source, moment: Moment) -> None:
        """Record the fingerprint of a frame's state, or compare it with that of the run which is resumed."""
        if moment.number % min(_CHECKED, self._chunking.frames) == 0:
            heights = (source.ripples[name].height for name in source.ripples)
            self._open.check_state(moment.number, state_digest(moment.data, heights))

    def save(self) -> None:
        """Bring what is in memory to the disk."""
        if self._layer is not None:
            save(self._layer)

    def finish(self, folder: Path, last: int) -> None:
        """Complete the layers, hand them over to a folder, and join them in the root layer up to the last frame."""
        if self._layer is not None:
            self._end()
        part = self._open
        names = [(segment.name, first) for segment, first in part.segments()]
        part.hand_over(folder)
        self._part = None
        first_layer = Sdf.Layer.FindOrOpen(str(folder / names[0][0]))
        manifest = Usd.ClipsAPI.GenerateClipManifestFromLayers([first_layer], self._path)
        manifest.comment = MARK
        manifest.Export(str(folder / _MANIFEST))
        clips = Usd.ClipsAPI(self._stage.GetPrimAtPath(self._path))
        clips.SetClipAssetPaths(Sdf.AssetPathArray([Sdf.AssetPath(f"./{folder.name}/{name}") for name, _ in names]))
        clips.SetClipPrimPath(str(self._path))
        clips.SetClipActive(Vt.Vec2dArray([(first, number) for number, (_, first) in enumerate(names)]))
        clips.SetClipTimes(Vt.Vec2dArray([(0, 0), (max(last, 1), max(last, 1))]))
        clips.SetClipManifestAssetPath(Sdf.AssetPath(f"./{folder.name}/{_MANIFEST}"))

    def close(self) -> str:
        """Give up; keep complete layers if the run can be resumed, and say so."""
        self._drop()
        part, self._part = self._part, None
        if part is None:
            return ""
        if self._chunking.settings is None:
            part.remove()
            return ""
        return f"{part.frames} frames are kept in {part.folder}; --resume carries on from there" if part.keep() else ""

    @property
    def _open(self) -> Part:
        if self._part is None:
            raise ValueError("the chunks are closed")
        return self._part

    def _begin(self) -> None:
        layer = Sdf.Layer.CreateNew(str(self._open.unfinished))
        layer.comment = MARK
        root = self._stage.GetRootLayer()
        layer.timeCodesPerSecond, layer.framesPerSecond = root.timeCodesPerSecond, root.framesPerSecond
        self._stage.GetSessionLayer().subLayerPaths = [layer.identifier]
        self._layer = layer

    def _sample(self, write: Callable[[], None]) -> None:
        with Usd.EditContext(self._stage, self._layer):
            write()

    def _end(self) -> None:
        self.save()
        self._drop()
        self._open.store(self._waiting)
        self._waiting = 0

    def _drop(self) -> None:
        self._stage.GetSessionLayer().subLayerPaths = []
        self._layer = None
