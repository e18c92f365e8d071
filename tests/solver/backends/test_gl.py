"""Buffers, compute shaders and moved stiffness on the GPU against numpy and the CPU."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver import (
    Atlas,
    Material,
    Mesh,
    TexelMesh,
    WaveSolver,
    build_atlas,
    sphere_atlas,
    texel_atlas,
)
from ripple_sim.solver.backends import FieldLayout, TexelList, bind_buffers
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.solver.texels.moving import MovedStencil

pytestmark = pytest.mark.usefixtures("computes")
MESHES = [square(1), square(66), flat_torus(17), polygon(3, 9), two_squares(3)]


@pytest.fixture(params=MESHES, ids=lambda each: str(each.shape))
def texels(request: pytest.FixtureRequest) -> TexelMesh:
    return request.param


def field(texels: TexelMesh, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(texels.shape).astype(np.float32)


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_a_list_is_run_to_its_last_entry_and_not_beyond(count: int) -> None:
    gl = shared_context()
    texels = square(15)
    layout = FieldLayout(gl, texels.topology)
    h = field(texels, 3)
    v = field(texels, 4)
    kicks = np.random.default_rng(5).standard_normal(225).astype(np.float32)
    with gl as ctx:
        height = layout.upload(h)
        velocity = layout.upload(v)
        places = ctx.buffer(layout.texels.astype(np.int32).tobytes())
        shader = layout.shader("kick")
        shader["dt"] = 0.5
        bind_buffers(height, velocity, places, ctx.buffer(kicks.tobytes()))
        layout.run_list(shader, count)
    kicks[count:] = 0
    np.testing.assert_allclose(layout.read(velocity).ravel(), v.ravel() + kicks, rtol=1e-6)
    np.testing.assert_allclose(
        layout.read(height).ravel(), h.ravel() + 0.5 * kicks, rtol=1e-5, atol=1e-6
    )


def test_a_list_grows_when_it_must_and_may_be_empty() -> None:
    entries = TexelList(shared_context())
    assert entries.count == 0
    for count in (3, 1024, 1025, 5000, 2, 0):
        places = np.arange(count) + 7
        values = np.linspace(0, 1, count)
        entries.set(places, values)
        assert entries.count == count
        with shared_context():
            kept = (
                np.frombuffer(entries.places.read(), np.int32),
                np.frombuffer(entries.values.read(), np.float32),
            )
        for found, expected in zip(kept, (places, values.astype(np.float32)), strict=True):
            np.testing.assert_array_equal(found[:count], expected)


SPHERE = sphere_atlas(1.0, 6)


def bowl() -> Atlas:
    """A surface with a rim, with corners of other than four charts in it and on it."""
    mesh = SPHERE.mesh
    low = mesh.V[mesh.F][..., 2].mean(axis=1) < 0.4
    return build_atlas(Mesh.from_arrays(mesh.V, mesh.F[low]), 8, layout="patches")


SURFACES = {"sphere": lambda: SPHERE, "strips": lambda: texel_atlas(square(70)), "bowl": bowl}


@pytest.mark.parametrize(("rim", "tightening"), [("free", 0.0), ("fixed", 1.5)])
@pytest.mark.parametrize("name", SURFACES)
def test_weights_links_and_time_step_on_the_gpu_equal_those_on_the_cpu(
    opengl, monkeypatch, name: str, rim: str, tightening: float
):
    monkeypatch.setattr(GLContext, "software", False)
    atlas = SURFACES[name]()
    material = Material(
        speed=1.0 + 0.5 * atlas.barycentrics[..., 0], viscosity=1e-3, tightening=tightening
    )
    cpu, gl = (WaveSolver(atlas, material, backend=backend, rim=rim) for backend in ("cpu", "gl"))
    matrix = np.eye(3) + 0.3 * np.random.default_rng(4).standard_normal((3, 3))
    for shift in (10.0, 20.0):
        for waves in (cpu, gl):
            waves.move(atlas.mesh.V @ (matrix * shift / 10) + shift)
    made = gl._backend._stencil
    (charts, n, _) = atlas.areas.shape
    assert hasattr(MovedStencil, "_stencil_and_areas")
    assert "_stencil_and_areas" not in vars(gl.operator.stencil)  # the CPU computed nothing
    with shared_context():
        fields = np.frombuffer(made.buffer.read(), np.float32).reshape(4, charts, n + 2, n + 2)
    links = fields[:, :, :-1, :-1]
    exact = cpu.operator.stencil.weights.swapaxes(0, 1)
    assert np.abs(links - exact).max() < 1e-6 * np.abs(exact).max()
    irregular = cpu.operator.stencil.irregular
    np.testing.assert_allclose(made.irregular.weights, irregular.weights, rtol=1e-9)
    assert gl.stable_timestep == pytest.approx(cpu.stable_timestep, rel=2e-6)
    np.testing.assert_allclose(gl._areas, cpu._areas)
