"""All finished scenes of a batch."""

from __future__ import annotations

from collections.abc import Container, Iterator

from .finished import FinishedScene, FolderFiles, scenes_in_tar
from .folder import BatchFolder


def finished_scenes(batch: BatchFolder, known: Container[int] = ()) -> Iterator[FinishedScene]:
    """The scenes that are there, each once, but for those that are known."""
    loose = [int(folder.name) for folder in sorted(batch.scenes.iterdir()) if folder.name.isdecimal()]
    packed: set[int] = set()
    for tar in batch.tar_files():  # looked at later than the folders, so that no scene is missed on its way into one
        for scene in scenes_in_tar(tar):
            packed.add(scene.number)
            if scene.number not in known:
                yield scene
    for number in loose:
        if number not in packed and number not in known:
            yield FinishedScene(number, FolderFiles(batch.scene(number)))
