"""Scenes with a shutter and a lens."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from exposed_scene import MJCF, SHOT, THROW, TOML
from scene_files import write_scene

from ripple_sim.scene import Scene, load_scene, with_exposure


@pytest.fixture
def make_scene(tmp_path: Path) -> Callable[..., Scene]:
    def make(bodies: str = SHOT, script: str = THROW, **exposure: Any) -> Scene:
        path = write_scene(tmp_path, MJCF.format(bodies=bodies), TOML + script)
        return with_exposure(load_scene(path), **exposure)

    return make
