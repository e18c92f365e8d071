"""A session on a ball."""

import pytest

from ripple_sim.scene.scene import Scene
from ripple_sim.viewer.opening import open_scene
from ripple_sim.viewer.session import Session


@pytest.fixture(scope="module")
def scene() -> Scene:
    return open_scene("sphere")


@pytest.fixture
def session(scene: Scene) -> Session:
    return Session(scene, resolution=24)
