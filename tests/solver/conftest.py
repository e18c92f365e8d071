"""Surfaces that several tests share. Everything is made here; nothing is read from files."""

import pytest
import trimesh

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas


@pytest.fixture(scope="session")
def ball_mesh() -> Mesh:
    """A unit sphere as a fine mesh."""
    solid = trimesh.creation.icosphere(subdivisions=5)
    return Mesh.from_arrays(solid.vertices, solid.faces)


@pytest.fixture(scope="session")
def animal() -> Atlas:
    """Atlas of a concave mesh with four limbs and a head."""
    return build_atlas(Mesh.from_arrays(*limbed()), 64)


@pytest.fixture
def gl_backend(computes: None) -> str:
    """The GL backend; skipped where it cannot run."""
    return "gl"


@pytest.fixture(params=["cpu", "gl"])
def backend(request: pytest.FixtureRequest) -> str:
    """Each wave backend in turn."""
    return request.getfixturevalue("gl_backend") if request.param == "gl" else request.param
