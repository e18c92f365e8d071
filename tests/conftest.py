"""Keep the tests' atlases out of the user's cache; what tests of several rooms need."""

import os
import select
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ripple_sim.solver import Atlas

# reasons to skip a test that hold on a machine that has everything else: extras under another
# licence, data that is not shipped, and what new systems do not have any more
_ALLOWED_SKIPS = ("pymeshfix", "bpy", "known meshes", "OSMesa")

# of the first process: those that it starts find atlases there
if "RIPPLE_SIM_TESTS" not in os.environ:
    _cache = tempfile.TemporaryDirectory(prefix="ripple-sim-tests-")
    os.environ |= dict.fromkeys(("RIPPLE_SIM_TESTS", "XDG_CACHE_HOME"), _cache.name)
    # what a software driver has compiled, under a hash of the shaders, is good for the next tests
    # too
    _shaders = Path(__file__).parents[1] / ".pytest_cache" / "shaders"
    # the driver makes one folder and not two, and complains
    _shaders.mkdir(parents=True, exist_ok=True)
    os.environ["MESA_SHADER_CACHE_DIR"] = str(_shaders)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where everything is installed a skipped test is a failure."""
    if os.environ.get("CI") != "true":
        return
    reporter = session.config.pluginmanager.getplugin("terminalreporter")
    skipped = reporter.stats.get("skipped", ())
    wrong = [
        report
        for report in skipped
        if not any(word in str(report.longrepr) for word in _ALLOWED_SKIPS)
    ]
    for report in wrong:
        reporter.write_line(
            f"skipped where nothing may be: {report.nodeid}: {report.longrepr}", red=True
        )
    if wrong:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.fixture
def signals_as_found() -> Iterator[None]:
    kept = {
        number: signal.getsignal(number)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    }
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def opengl() -> None:
    from ripple_sim.solver import RippleError
    from ripple_sim.solver.gl import shared_context

    try:
        shared_context()
    except RippleError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def computes(opengl: None) -> None:
    """OpenGL 4.3, which has compute shaders; skipped with an older driver."""
    from ripple_sim.solver.gl import shared_context

    if not shared_context().computes:
        pytest.skip("the driver has no compute shaders, which came with OpenGL 4.3")


@pytest.fixture(scope="session")
def animal() -> "Atlas":
    """Atlas of a mesh with limbs."""
    from ripple_sim.scenes.shapes import limbed
    from ripple_sim.solver import Mesh, build_atlas

    return build_atlas(Mesh.from_arrays(*limbed()), 32)


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
