"""What several tests of the application need."""

import pytest

from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import shared_context


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where there is no OpenGL."""
    try:
        shared_context()
    except RippleError as error:
        pytest.skip(str(error))
