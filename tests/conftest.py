"""Keep the tests' atlases out of the user's cache; what tests of several rooms need."""

import os
import tempfile
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ripple_sim.solver import Atlas

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


@pytest.fixture(scope="session")
def animal() -> "Atlas":
    """Atlas of a mesh with limbs."""
    from ripple_sim.scenes.shapes import limbed
    from ripple_sim.solver import Mesh, build_atlas

    return build_atlas(Mesh.from_arrays(*limbed()), 32, cache=False)
