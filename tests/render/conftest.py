"""What tests of the renderer share."""

from collections.abc import Iterator

import pytest

from ripple_sim.render import FrameUniforms, Resources
from ripple_sim.solver.gl import GLContext, shared_context


@pytest.fixture(scope="session")
def gl(opengl: None) -> GLContext:
    """The process's OpenGL context; software will do."""
    return shared_context()


@pytest.fixture
def resources(gl: GLContext) -> Iterator[Resources]:
    """Resources made and used in the context, as the renderer's are."""
    with gl:
        made = Resources(gl, owner=gl)
        yield made
        made.release()


@pytest.fixture
def frame(resources: Resources) -> FrameUniforms:
    return FrameUniforms(resources)
