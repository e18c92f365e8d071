"""A small scene of its own for each test."""

import pytest
from unfinished_videos import egg_scene

from ripple_sim.scene import Scene


@pytest.fixture
def scene(tmp_path, opengl) -> Scene:
    return egg_scene(tmp_path)
