"""The folder of a batch: its files, the finished scenes, and the scenes being made.

- `plan.json`: the plan of the scenes;
- `scenes/000012`: a finished scene; or its files are in `tars/000000.tar`;
- `work/000012`: a scene that is being made, and `work/000012.lock`, the lock of the process that
  makes it;
- `failed/000012.json` and `.log`: what went wrong with a scene.

A scene is finished when its folder is renamed from `work` to `scenes`: nothing else has to be kept
in step. WebDataset reads the tar files: the files of a scene stand one after another, and their
names begin with its number.
"""

from __future__ import annotations

import contextlib
import hashlib
import re
import shutil
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from ripple_sim.encode.locks import FileLock
from ripple_sim.encode.replace import sync
from ripple_sim.errors import BatchError, SceneError
from ripple_sim.scene.loading import load_scene
from ripple_sim.solver.errors import shown
from ripple_sim.solver.files import atomic_write
from ripple_sim.video.settings import scene_digest, versions

from .plan import Plan, check_plan

# The number of a scene in a file name.
NUMBER = re.compile(r"\d{6,}")

# A scene is put aside after so many errors of its own, or after so many deaths of its worker, which
# may have another reason.
ERRORS = 3
DEATHS = 9


def times_of(tar: Path) -> Path:
    """The file that says how long the scenes of a tar file took, and who made them.

    It is not in the tar file, whose bytes must not depend on it.
    """
    return tar.with_suffix(".times.json")


def members(tar: Path) -> dict[int, dict[str, tarfile.TarInfo]]:
    """The files in a tar file by their names, by scene; raises `BatchError` if it is damaged."""
    files: dict[int, dict[str, tarfile.TarInfo]] = {}
    try:
        with tarfile.open(tar) as file:
            for member in file:
                number, name = member.name.split(".", 1)
                files.setdefault(int(number), {})[name] = member
    except (tarfile.TarError, EOFError, ValueError, OSError) as error:
        raise BatchError(
            f"{tar} is damaged: {error}; remove it, and run the batch again"
        ) from error
    return files


class Failure(msgspec.Struct):
    """The failures of a scene: its own errors, the deaths of its worker, and the last message."""

    errors: int = 0
    deaths: int = 0
    error: str = ""

    @property
    def attempts(self) -> int:
        """How often the scene was tried."""
        return self.errors + self.deaths

    @property
    def aside(self) -> bool:
        """Whether the scene is not tried again unless the user asks."""
        return self.errors >= ERRORS or self.deaths >= DEATHS


class BatchFolder:
    """The folder of a batch on the disk."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plan = path / "plan.json"
        self.scenes = path / "scenes"
        self.tars = path / "tars"
        self.failed = path / "failed"
        self.thumbnails = path / "thumbnails"
        self.work = path / "work"
        self.index = path / "index.parquet"
        self.page = path / "index.html"

    def make(self) -> None:
        """Make the folders.

        Raises `BatchError` if one of them is or contains a link, which would lead out of the batch.
        """
        folders = (self.scenes, self.tars, self.failed, self.thumbnails, self.work)
        for folder in (self.path, *folders):
            for path in _entries(folder):
                _check_no_link(path)
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)

    def scene(self, number: int) -> Path:
        """Folder of a finished scene."""
        return self.scenes / f"{number:06d}"

    def thumbnail(self, number: int) -> Path:
        """A small image of a scene."""
        return self.thumbnails / f"{number:06d}.jpg"

    def finished(self) -> set[int]:
        """Numbers of the finished scenes."""
        # the folders first: scenes move into tar files meanwhile
        return self.loose().union(*map(members, self.tar_files()))

    def loose(self) -> set[int]:
        """Numbers of the scenes that have a folder."""
        return {int(path.name) for path in _entries(self.scenes) if NUMBER.fullmatch(path.name)}

    def is_finished(self, number: int) -> bool:
        """Whether a scene is finished."""
        if self.scene(number).exists():
            return True
        # tar files have the numbers of their first scenes
        tars = [tar for tar in self.tar_files() if int(tar.stem) <= number]
        return bool(tars) and number in members(tars[-1])

    def tar(self, first: int) -> Path:
        """Tar file of the scenes from a number on."""
        return self.tars / f"{first:06d}.tar"

    def tar_files(self) -> list[Path]:
        """The tar files, in their order."""
        return sorted(
            path for path in _entries(self.tars) if path.suffix == ".tar" and path.stem.isdecimal()
        )

    @contextlib.contextmanager
    def claimed(self, number: int) -> Iterator[Path | None]:
        """Lock a scene against other processes; yields the folder to make it in, see `finish`.

        None if another process makes it now, or it is finished. A process that dies leaves no lock
        behind.
        """
        work = self.work / f"{number:06d}"
        # beside the folder, which Windows renames only while no file in it is open
        lock = FileLock(self.work / f"{number:06d}.lock")
        is_claimed = lock.try_acquire()
        try:
            if is_claimed and self.is_finished(number):  # by another process, meanwhile
                is_claimed = False
                with contextlib.suppress(OSError):  # the folder is not there, or not empty
                    work.rmdir()
            if is_claimed:
                _check_no_link(work)
                work.mkdir(parents=True, exist_ok=True)
            yield work if is_claimed else None
        finally:
            lock.release()

    def finish(self, number: int, work: Path) -> None:
        """Put a scene that was made in `work` in its place, whole and on the disk."""
        for path in (*work.rglob("*"), work):
            sync(path)
        work.rename(self.scene(number))

    def failures(self) -> dict[int, Failure]:
        """The scenes that have failed, also those that may yet succeed."""
        failures = {}
        for path in _entries(self.failed):
            if path.suffix == ".json" and NUMBER.fullmatch(path.stem):
                with contextlib.suppress(ValueError, RecursionError):
                    failure = msgspec.json.decode(path.read_bytes(), type=Failure)
                    failures[int(path.stem)] = failure
        return failures

    def note_failure(self, number: int, failure: Failure, log: str) -> None:
        """Keep what went wrong with a scene."""
        with (self.failed / f"{number:06d}.log").open("a") as file:
            file.write(f"attempt {failure.attempts}: {failure.error}\n{log}\n")
        with atomic_write(self.failed / f"{number:06d}.json") as path:
            path.write_bytes(msgspec.json.encode(failure))

    def forget_failure(self, number: int) -> None:
        """Remove what went wrong with a scene."""
        for ending in ("json", "log"):
            (self.failed / f"{number:06d}.{ending}").unlink(missing_ok=True)

    def check(self) -> None:
        """Make sure that this is the folder of a batch; raises `BatchError`."""
        if not self.plan.is_file():
            raise BatchError(
                f"{self.path} is not the folder of a batch: it has no plan.json; make one by "
                "`ripple-sim batch PLAN.toml -o DIR`"
            )


def _check_no_link(path: Path) -> None:
    """Raise `BatchError` if a path is a link: it may lead out of the batch."""
    if path.is_symlink():
        raise BatchError(
            f"{path} is a link, which no batch makes; remove it and run the same command again"
        )


def clear(folder: Path) -> None:
    """Remove everything in a folder."""
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _entries(folder: Path) -> list[Path]:
    """Everything in a folder, in order; nothing if it is missing."""
    return sorted(folder.iterdir()) if folder.is_dir() else []


class StoredPlan(msgspec.Struct, frozen=True):
    """A plan, the fingerprints of its files, and the versions of the software.

    Together they determine every byte of the scenes.
    """

    plan: Plan
    files: dict[str, str]
    versions: dict[str, str]


def stored(plan: Plan) -> StoredPlan:
    """The plan with the fingerprints of its files; reads all of them.

    Raises `RippleError` if one is invalid.
    """
    files = {}
    for source in dict.fromkeys(plan.sources):
        if Path(source).suffix in ("", ".toml"):
            files[source] = scene_digest(load_scene(source))
        else:
            files[source] = hashlib.blake2b(Path(source).read_bytes(), digest_size=8).hexdigest()
    return StoredPlan(plan, files, versions())


def keep_plan(batch: BatchFolder, plan: StoredPlan) -> None:
    """Write the plan into the folder of its batch, or make sure that the one there is the same.

    Raises `BatchError` naming what has changed.
    """
    if batch.plan.exists():
        _check_same_plan(batch, load_stored(batch.plan), plan)
    elif batch.path.is_dir() and any(batch.path.iterdir()):
        raise BatchError(f"{batch.path} holds other files and no batch; name a new folder")
    batch.make()
    with atomic_write(batch.plan) as path:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(plan), indent=1))


def _check_same_plan(batch: BatchFolder, old_plan: StoredPlan, new_plan: StoredPlan) -> None:
    """Raise `BatchError` if a plan differs from the one in the folder of its batch.

    The number of scenes may differ: a larger batch begins like a smaller one.
    """
    old = _flat(old_plan)
    new = _flat(new_plan)
    keys = (old.keys() | new.keys()) - {"plan.count"}
    changed = sorted(key for key in keys if old.get(key) != new.get(key))
    if not changed:
        return
    key = changed[0]
    others = ""
    if len(changed) > 1:
        others = f", and {len(changed) - 1} more ({', '.join(changed[1:4])})"
    raise BatchError(
        f"{batch.path} holds a batch by another plan: {key} was {shown(old.get(key))} and is "
        f"{shown(new.get(key))}{others}; take it back, or name another folder"
    )


def load_stored(path: Path) -> StoredPlan:
    """Read the plan in the folder of a batch; raises `BatchError`."""
    try:
        stored_plan = msgspec.json.decode(path.read_bytes(), type=StoredPlan)
        check_plan(stored_plan.plan)
        return stored_plan
    # strings that are not UTF-8 are a ValueError
    except (OSError, RecursionError, ValueError, SceneError) as error:
        raise BatchError(
            f"{path} cannot be read: {error}; it is the plan of a batch and must stay as it is"
        ) from error


def _flat(value: Any) -> dict[str, Any]:
    """The values of a stored plan by keys with dots.

    Files are named without their folders, so that a plan may move along with its files.
    """
    content = msgspec.to_builtins(value)
    plan = content["plan"]
    plan["sources"] = [Path(source).name for source in plan["sources"]]
    content["files"] = {Path(source).name: digest for source, digest in content["files"].items()}
    values: dict[str, Any] = {}

    def add(table: dict[str, Any], prefix: str) -> None:
        for key, value in table.items():
            name = f"{prefix}.{key}" if prefix else key
            if isinstance(value, dict) and prefix not in ("plan.vary", "plan.model"):
                add(value, name)
            else:
                values[name] = value

    add(content, "")
    return values
