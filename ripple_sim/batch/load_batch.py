"""`load_batch`: the finished scenes of a batch, one after another or by number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ripple_sim.errors import BatchError
from ripple_sim.solver.errors import PATH, checked

from .finished import FinishedScene
from .finished_scenes import finished_scenes
from .folder import BatchFolder
from .report import parquet


class Batch(Sequence):
    """The scenes of a batch that were finished when it was loaded, in the order of their numbers.

    It may be sent to other processes, such as a loader's workers; files are read when they are asked for.

    Attributes
    ----------
    path : Path
    numbers : list of int
        Of the scenes; one that failed is not among them.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._scenes = sorted(finished_scenes(BatchFolder(path)), key=lambda scene: scene.number)
        self.numbers = [scene.number for scene in self._scenes]

    def __len__(self) -> int:
        return len(self._scenes)

    def __getitem__(self, place: Any) -> Any:
        """The scene at a place among those that are there; its number is another if some are missing."""
        return self._scenes[place]

    def __iter__(self) -> Iterator[FinishedScene]:
        return iter(self._scenes)

    def table(self) -> Any:
        """The Parquet index as a table of pyarrow; `.to_pandas()` makes a data frame of it."""
        return parquet().read_table(BatchFolder(self.path).index)


@checked(BatchError, path=PATH)
def load_batch(path: str | Path) -> Batch:
    """Load a batch from its folder, also while others still make scenes of it.

    Raises
    ------
    BatchError
        If there is no batch in the folder.
    """
    path = Path(path).absolute()
    BatchFolder(path).check()
    return Batch(path)
