"""A session on a ball, and a virtual screen."""

import os
import select
import shutil
import subprocess
from collections.abc import Iterator

import pytest

from ripple_sim.scene import Scene
from ripple_sim.viewer import Session, open_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return open_scene("sphere")


@pytest.fixture
def session(scene: Scene) -> Session:
    return Session(scene, resolution=24)


@pytest.fixture
def screen() -> Iterator[str]:
    """Name of a display on a virtual screen."""
    if shutil.which("Xvfb") is None:
        pytest.skip("needs Xvfb (on Debian and Ubuntu: apt-get install xvfb)")
    reading, writing = os.pipe()
    words = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
    server = subprocess.Popen(words, pass_fds=[writing], stderr=subprocess.DEVNULL)
    os.close(writing)
    try:
        assert select.select([reading], [], [], 20)[0], "Xvfb does not start"
        yield f":{os.read(reading, 16).decode().strip()}"
    finally:
        os.close(reading)
        server.terminate()
        server.wait()
