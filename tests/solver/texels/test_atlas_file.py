"""Atlas files: which versions are read, and the messages for files that are no atlas."""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import AtlasError
from ripple_sim.solver.texels import FORMAT, read_atlas_file, write_arrays, write_atlas_file


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {
        "kind": np.array(["Atlas", "given"]),
        "V": rng.standard_normal((4, 3)),
        "F": np.array([[0, 1, 2], [0, 2, 3]]),
        "glued": np.full((1, 4, 2), -1),
        "positions": rng.standard_normal((1, 4, 4, 3)),
        "normals": rng.standard_normal((1, 4, 4, 3)),
        "areas": rng.uniform(size=(1, 4, 4)),
        "triangles": rng.integers(0, 2, (1, 4, 4)),
        "barycentrics": rng.uniform(size=(1, 4, 4, 3)),
        "charts": np.zeros(2, np.int64),
    }


def written(path: Path, arrays: dict[str, np.ndarray]) -> Path:
    with path.open("wb") as file:
        write_arrays(file, arrays)
    return path


def test_another_version_is_refused_with_the_advice_to_make_it_again(
    tmp_path: Path, arrays
) -> None:
    for version in (12, FORMAT + 1):
        path = written(tmp_path / "other.atlas", {**arrays, "format": np.array([version])})
        message = r"other\.atlas.* of another version; make it again with `ripple-sim atlas"
        with pytest.raises(AtlasError, match=message):
            read_atlas_file(path)


@pytest.mark.parametrize("version", range(13, FORMAT))
def test_files_since_version_1_0_0_are_read(tmp_path: Path, arrays, version: int) -> None:
    path = written(tmp_path / "old.atlas", {**arrays, "format": np.array([version])})
    np.testing.assert_array_equal(read_atlas_file(path)["areas"], arrays["areas"])


@pytest.mark.parametrize("missing", ["V", "glued", "kind", "barycentrics", "format"])
def test_a_file_that_lacks_an_array_is_not_an_atlas(tmp_path: Path, arrays, missing: str) -> None:
    whole = {**arrays, "format": np.array([FORMAT])}
    del whole[missing]
    with pytest.raises(AtlasError, match=r"half\.atlas.* is not an atlas"):
        read_atlas_file(written(tmp_path / "half.atlas", whole))


def test_a_truncated_file_is_named_as_damaged(
    tmp_path: Path, arrays: dict[str, np.ndarray]
) -> None:
    path = tmp_path / "cut.atlas"
    write_atlas_file(path, arrays)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(
        AtlasError, match=r"cut\.atlas.* is damaged or not an atlas \(.+\); make it again"
    ):
        read_atlas_file(path)


def test_a_missing_file_and_a_folder_have_different_errors(tmp_path: Path) -> None:
    with pytest.raises(AtlasError, match=r"none\.atlas' does not exist; make one with"):
        read_atlas_file(tmp_path / "none.atlas")
    with pytest.raises(AtlasError, match="is not a file; make one with"):
        read_atlas_file(tmp_path)


def test_a_file_that_cannot_be_written_is_named_and_leaves_nothing(tmp_path: Path, arrays) -> None:
    folder = tmp_path / "folder.atlas"
    folder.mkdir()
    with pytest.raises(
        AtlasError, match=r"folder\.atlas' cannot be written: it exists and is not a regular file"
    ):
        write_atlas_file(folder, arrays)
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(AtlasError, match="cannot be written: "):
        write_atlas_file(tmp_path / "file" / "an.atlas", arrays)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["file", "folder.atlas"]
