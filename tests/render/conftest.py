"""What tests of the renderer share."""

import pytest

from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext, shared_context


@pytest.fixture(scope="session")
def gl() -> GLContext:
    """The process's OpenGL context; software will do."""
    try:
        return shared_context()
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")
