"""The stiffness that the GPU makes of moved vertices against the CPU's."""

import numpy as np
import pytest
from hand_made import square

from ripple_sim.solver import Atlas, Material, Mesh, WaveSolver, build_atlas, sphere_atlas, texel_atlas
from ripple_sim.solver.gl import GLContext, shared_context

SPHERE = sphere_atlas(1.0, 6)


def bowl() -> Atlas:
    """A surface with a rim, with corners of other than four charts in it and on it."""
    mesh = SPHERE.mesh
    low = mesh.V[mesh.F][..., 2].mean(axis=1) < 0.4
    return build_atlas(Mesh.from_arrays(mesh.V, mesh.F[low]), 8, layout="patches")


SURFACES = {"sphere": lambda: SPHERE, "strips": lambda: texel_atlas(square(70)), "bowl": bowl}


@pytest.mark.parametrize(("rim", "tightening"), [("free", 0.0), ("fixed", 1.5)])
@pytest.mark.parametrize("name", SURFACES)
def test_weights_links_and_time_step_are_those_of_the_cpu(
    opengl: None, monkeypatch: pytest.MonkeyPatch, name: str, rim: str, tightening: float
) -> None:
    monkeypatch.setattr(GLContext, "software", False)
    atlas = SURFACES[name]()
    material = Material(speed=1.0 + 0.5 * atlas.barycentrics[..., 0], viscosity=1e-3, tightening=tightening)
    cpu, gl = (WaveSolver(atlas, material, backend=backend, rim=rim) for backend in ("cpu", "gl"))
    matrix = np.eye(3) + 0.3 * np.random.default_rng(4).standard_normal((3, 3))
    for shift in (10.0, 20.0):
        for waves in (cpu, gl):
            waves.move(atlas.mesh.V @ (matrix * shift / 10) + shift)
    fields, made = gl._backend._fields, gl._backend._stencil
    pairs = fields.link_addresses()
    assert made.on_device
    with shared_context():
        laid = np.frombuffer(made.buffer.read(), np.float32).reshape(-1, 4)[pairs[:, 1]]
    charts, n, _ = atlas.areas.shape
    weights = np.zeros((charts, n + 2, n + 2, 4))
    weights[:, :-1, :-1] = np.moveaxis(cpu.operator.stencil.weights, 1, -1)
    exact = weights.reshape(-1, 4)[pairs[:, 0]]
    assert np.abs(laid - exact).max() < 1e-6 * np.abs(exact).max()
    irregular = cpu.operator.stencil.irregular
    if irregular is not None:
        np.testing.assert_allclose(made.irregular.weights, irregular.weights, rtol=1e-9)
    assert gl.stable_timestep == pytest.approx(cpu.stable_timestep, rel=2e-6)
    np.testing.assert_allclose(gl._areas, cpu._areas)
