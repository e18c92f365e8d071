"""A session on a ball."""

import pytest

from ripple_sim.scene import Scene
from ripple_sim.viewer import Session, open_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return open_scene("sphere")


@pytest.fixture
def session(scene: Scene) -> Session:
    return Session(scene, resolution=24)
