"""One small batch, made without a break, that others are compared with."""

import pytest
from small_batch import new_batch

from ripple_sim.batch import BatchFolder, make_scene


@pytest.fixture(scope="session")
def unbroken(opengl, tmp_path_factory) -> BatchFolder:
    """Five scenes with videos, made one after another in this process."""
    batch = new_batch(tmp_path_factory.mktemp("unbroken"), "heights = true\n")
    for number in range(5):
        assert make_scene(str(batch.path), number).state == "made"
    return batch
