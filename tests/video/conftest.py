"""A small scene of its own for each test."""

import pytest
from unfinished_videos import MJCF, TOML

from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import shared_context


@pytest.fixture
def scene(tmp_path) -> Scene:
    try:
        shared_context()
    except RippleError as error:
        pytest.skip(str(error))
    (tmp_path / "scene.xml").write_text(MJCF)
    (tmp_path / "scene.toml").write_text(TOML)
    return load_scene(tmp_path / "scene.toml")
