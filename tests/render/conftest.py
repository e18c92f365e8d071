"""What tests of the renderer share."""

from collections.abc import Iterator

import pytest

from ripple_sim.render import FrameUniforms, Resources
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext, shared_context


@pytest.fixture(scope="session")
def gl() -> GLContext:
    """The process's OpenGL context; software will do."""
    try:
        return shared_context()
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")


class Owner:
    """Whoever owns resources of the GPU."""


@pytest.fixture
def resources(gl: GLContext) -> Iterator[Resources]:
    """Resources made and used in the context, as the renderer's are."""
    owner = Owner()
    with gl:
        made = Resources(gl, owner)
        yield made
        made.release()


@pytest.fixture
def frame(resources: Resources) -> FrameUniforms:
    """Uniforms of a frame."""
    return FrameUniforms(resources)
