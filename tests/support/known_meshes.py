"""The known meshes, in the folder `shared/meshes` beside the checkout."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "meshes"


def known_mesh(name: str) -> Path:
    """Path of a known mesh such as "good/spot.obj".

    Where the whole folder is absent the test is skipped.
    """
    if not FOLDER.is_dir():
        pytest.skip(f"the known meshes are not here: {FOLDER} does not exist")
    return FOLDER / name
