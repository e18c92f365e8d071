"""A session on a ball."""

import pytest

from ripple_sim.scene import Scene
from ripple_sim.viewer import Opened, Session, opened


@pytest.fixture(scope="module")
def ball() -> Opened:
    return opened("sphere")


@pytest.fixture(scope="module")
def scene(ball: Opened) -> Scene:
    return ball.scene


@pytest.fixture
def session(scene: Scene) -> Session:
    return Session(scene, resolution=24)
