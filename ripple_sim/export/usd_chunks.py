"""`Chunks`: the frames of a long run of USD in files of their own, which a root layer joins.

The files are value clips. Until the run is complete they lie in a folder of unfinished parts, from
which the run can be resumed. Metadata tell a file made here from others.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
from pxr import Sdf, Tf, Usd, Vt

from ripple_sim.capture.snapshot import state_digest
from ripple_sim.encode.part import Part
from ripple_sim.encode.replace import MARK
from ripple_sim.errors import VideoError
from ripple_sim.solver.files import final_path

from .source import Source

# Frames from one fingerprint of the simulation's state to the next, at most. An export that is
# resumed compares them.
_MAX_FINGERPRINT_INTERVAL = 16

_MANIFEST = "manifest.usdc"  # name of the file that lists the attributes of the chunks


def succeed(work: Callable[..., bool], *arguments: object) -> None:
    """Call a function that returns whether it could write; raise OSError if it could not."""
    try:
        if work(*arguments):
            return
        reason = "it could not be written"
    except Tf.ErrorException as error:
        text = " ".join(str(error).split())
        quoted = re.search(r"line \d+ in file \S+ : '(.*?)'(?= Error in |$)", text)
        reason = quoted[1] if quoted else text
    raise OSError(reason)


class Chunks:
    """Writes time samples to layers of some frames each, in a folder until the run is complete.

    A layer has the first frame of the next one, too, so that readers interpolate between the two.
    What is the same at all times belongs in the stage's root layer. A layer is in memory until it
    is complete: one whose file could not be written, as on a full disk, ends the process as soon as
    the stage lets go of it.

    Parameters
    ----------
    path : Sdf.Path
        Prim of the stage under which everything lies that has time samples.

    Raises
    ------
    VideoError
        If another process writes to the same place, or a run that is to be resumed has other
        settings, or is damaged.
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, source: Source) -> None:
        self._stage = stage
        self._path = path
        self._source = source
        target = final_path(source.output)
        settings = source.settings or {}
        # None once it is handed over or closed
        self._part: Any = Part(
            target, ".usdc", source.chunk, settings, resume=source.resume, overwrite=True
        )
        damaged = [segment.name for segment, _ in self._part.segments if not made_here(segment)]
        if damaged:
            self._part.keep()
            raise VideoError(
                f"cannot resume {source.output}: {damaged[0]} is damaged; leave --resume out to "
                f"start again"
            )
        self.stored = self._part.frames
        self._layer: Any = None  # open while frames wait
        self._waiting = 0  # frames in it

    def write(self, write: Callable[[], None]) -> None:
        """Write a frame, by a function that sets its samples."""
        if self._layer is not None and self._waiting == self._source.chunk:
            self._sample(write)
            self._end()
        if self._layer is None:
            self._layer = layer = Sdf.Layer.CreateAnonymous(".usdc")
            layer.comment = MARK
            root = self._stage.GetRootLayer()
            layer.timeCodesPerSecond = root.timeCodesPerSecond
            layer.framesPerSecond = root.framesPerSecond
            self._stage.GetSessionLayer().subLayerPaths = [layer.identifier]
        self._sample(write)
        self._waiting += 1

    def check_state(self, number: int, data: mujoco.MjData) -> None:
        """Record the fingerprint of the state at a frame, or compare it with an earlier run's."""
        if number % min(_MAX_FINGERPRINT_INTERVAL, self._source.chunk) == 0:
            heights = (self._source.ripples[name].height for name in self._source.ripples)
            self._part.check_state(number, state_digest(data, heights))

    def finish(self, folder: Path, last: int) -> None:
        """Complete the layers, move them to a folder, and join them in the root layer.

        `last` is the number of the last frame.
        """
        if self._layer is not None:
            self._end()
        part = self._part
        self._part = None
        names = [(segment.name, first) for segment, first in part.segments]
        part.hand_over(folder)
        first_layer = Sdf.Layer.FindOrOpen(str(folder / names[0][0]))
        manifest = Usd.ClipsAPI.GenerateClipManifestFromLayers([first_layer], self._path)
        manifest.comment = MARK
        manifest.Export(str(folder / _MANIFEST))
        clips = Usd.ClipsAPI(self._stage.GetPrimAtPath(self._path))
        clips.SetClipAssetPaths(
            Sdf.AssetPathArray([Sdf.AssetPath(f"./{folder.name}/{name}") for name, _ in names])
        )
        clips.SetClipPrimPath(str(self._path))
        clips.SetClipActive(
            Vt.Vec2dArray([(first, number) for number, (_, first) in enumerate(names)])
        )
        clips.SetClipTimes(Vt.Vec2dArray([(0, 0), (max(last, 1), max(last, 1))]))
        clips.SetClipManifestAssetPath(Sdf.AssetPath(f"./{folder.name}/{_MANIFEST}"))

    def close(self) -> str:
        """Give up; keep complete layers if the run can be resumed, and say so."""
        self._drop()
        part = self._part
        self._part = None
        if part is not None and self._source.settings is None:
            part.remove()
            return ""
        return "" if part is None else part.keep()

    def _sample(self, write: Callable[[], None]) -> None:
        with Usd.EditContext(self._stage, self._layer):
            write()

    def _end(self) -> None:
        succeed(self._layer.Export, str(self._part.unfinished))
        self._drop()
        self._part.store(self._waiting)
        self._waiting = 0

    def _drop(self) -> None:
        self._stage.GetSessionLayer().subLayerPaths = []
        self._layer = None


def made_here(path: Path) -> bool:
    """Whether a layer has the mark as its comment."""
    if not path.is_file():
        return False
    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)
    except Tf.ErrorException:
        return False
    return layer is not None and layer.comment == MARK
