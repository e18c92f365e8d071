"""Keep the tests' atlases out of the user's cache; what tests of several rooms need."""

import os
import tempfile
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ripple_sim.solver import Atlas

# reasons to skip a test that hold on a machine that has everything else: extras under another licence, and data that
# is not shipped
_ALLOWED_SKIPS = ("pymeshfix", "bpy", "known meshes")

_cache = tempfile.TemporaryDirectory(prefix="ripple-sim-tests-")
os.environ["XDG_CACHE_HOME"] = _cache.name


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where everything is installed a skipped test is a failure."""
    if os.environ.get("CI") != "true":
        return
    reporter = session.config.pluginmanager.getplugin("terminalreporter")
    skipped = reporter.stats.get("skipped", ())
    wrong = [report for report in skipped if not any(word in str(report.longrepr) for word in _ALLOWED_SKIPS)]
    for report in wrong:
        reporter.write_line(f"skipped where nothing may be: {report.nodeid}: {report.longrepr}", red=True)
    if wrong:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where there is no OpenGL."""
    from ripple_sim.solver import RippleError
    from ripple_sim.solver.gl import shared_context

    try:
        shared_context()
    except RippleError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def animal() -> "Atlas":
    """Atlas of a mesh with limbs."""
    from ripple_sim.scenes.shapes import limbed
    from ripple_sim.solver import Mesh, build_atlas

    return build_atlas(Mesh.from_arrays(*limbed()), 32, cache=False)
