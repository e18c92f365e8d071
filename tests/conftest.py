"""Keep the tests' atlases out of the user's cache; what tests of several rooms need."""

import os
import tempfile

import pytest

_cache = tempfile.TemporaryDirectory(prefix="ripple-sim-tests-")
os.environ["XDG_CACHE_HOME"] = _cache.name


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where there is no OpenGL."""
    from ripple_sim.solver import RippleError
    from ripple_sim.solver.gl import shared_context

    try:
        shared_context()
    except RippleError as error:
        pytest.skip(str(error))
