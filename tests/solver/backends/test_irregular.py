"""Both backends on rims, irregular vertices and several parts."""

import dataclasses

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver import Material, WaveSolver, texel_atlas
from ripple_sim.solver.texels.stencil import stiffness_matrix

MATERIALS = {
    "membrane": Material(speed=1.0, damping=0.3),
    "viscous plate": Material(speed=0.5, bending=1e-4, viscosity=1e-3, stiffness=4.0),
}


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize(
    "texels", [square(11), polygon(3, 8), polygon(5, 9), polygon(6, 12), flat_torus(10), two_squares(7)], ids=str
)
def test_gl_equals_cpu(gl_backend: str, texels, material: str) -> None:
    atlas, heights = texel_atlas(texels), []
    start = np.random.default_rng(4).standard_normal(texels.shape).astype(np.float32)
    for backend in ("cpu", gl_backend):
        waves = WaveSolver(atlas, MATERIALS[material], backend=backend)
        waves.height = start
        waves.add_impulse(atlas.positions[0, 0, 0], 0.01, 0.3)
        waves.step(0.5)
        heights.append(waves.height)
    assert np.abs(heights[0] - heights[1]).max() < 1e-5 * np.abs(heights[0]).max()
    assert np.abs(heights[0] - start).max() > 0.1


def test_irregular_links_take_part(backend: str) -> None:
    """The first kick is that of the stiffness matrix, also round a vertex where five charts meet."""
    texels = polygon(5, 8)
    waves = WaveSolver(texel_atlas(texels), Material(speed=1.0), backend=backend, conserve_volume=False)
    height = np.random.default_rng(5).standard_normal(texels.shape).astype(np.float32)
    dt = 1e-3 * waves.stable_timestep
    waves.height = height
    waves.step(dt)
    softened = stiffness_matrix(waves.operator.stencil)
    expected = -dt * (softened @ height.ravel()).reshape(texels.shape) / texels.areas
    np.testing.assert_allclose(waves.velocity, expected, atol=1e-4 * np.abs(expected).max())
    without = dataclasses.replace(waves.operator.stencil, irregular=None)
    lacking = np.abs(without(height.astype(np.float64)) - waves.operator.stencil(height.astype(np.float64)))
    assert lacking[:, 0, 0].max() > 0.01 * np.abs(expected / dt * texels.areas).max()
    assert (lacking[:, 1:, 1:] == 0).all()
