"""Backends by name, and against each other on every feature and kind of surface."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver import (
    Atlas,
    GLError,
    Material,
    SolverError,
    TexelMesh,
    WaveSolver,
    sphere_atlas,
    texel_atlas,
)
from ripple_sim.solver.backends import auto_backend, backend_speed, make_backend
from ripple_sim.solver.gl import GLContext, context, shared_context
from ripple_sim.solver.layouts import build_atlas
from ripple_sim.solver.operator import WaveOperator, build_operator

STEPS = 1000


def north(atlas: Atlas) -> np.ndarray:
    return atlas.positions[..., 2] > 0.3


def maps(atlas: Atlas) -> Material:
    """Every coefficient a map of random numbers."""
    rng = np.random.default_rng(8)
    shape = atlas.areas.shape
    z = atlas.positions[..., 2]
    return Material(
        speed=rng.uniform(0, 0.6, shape) * (z < 0.1),
        damping=rng.uniform(0, 1, shape),
        stiffness=rng.uniform(0, 5, shape),
        viscosity=rng.uniform(0, 1e-3, shape),
        density=rng.uniform(1, 2, shape),
        bending=rng.uniform(0, 1e-6, shape) * (z < 0.1),
        yield_height=rng.uniform(1e-3, 1e-2, shape),
        fixed=atlas.positions[..., 0] > 0.2,
    )


FEATURES: dict[str, Callable[[Atlas], Material]] = {
    "plain": lambda atlas: Material(speed=1.0),
    "damping and density maps": lambda atlas: Material(
        1.0, damping=0.3 * north(atlas), density=1.0 + north(atlas)
    ),
    "speed map": lambda atlas: Material(speed=1.0 + 0.5 * atlas.positions[..., 0]),
    "reflecting region": lambda atlas: Material(speed=1.0 * ~north(atlas)),
    "fixed": lambda atlas: Material(speed=1.0, fixed=north(atlas)),
    "viscosity": lambda atlas: Material(speed=1.0, viscosity=1e-3),
    "bending and viscosity": lambda atlas: Material(speed=0.5, bending=1e-4, viscosity=1e-3),
    "every map": maps,
    "yield map": lambda atlas: Material(
        speed=1.0, yield_height=np.where(north(atlas), 5e-3, np.inf), stiffness=10.0
    ),
}


def struck(atlas: Atlas, material: Material, backend: str) -> list[np.ndarray]:
    """Height, velocity and dent after impulses, forces, pressure, velocity and height."""
    waves = WaveSolver(atlas, material, backend=backend)
    dt = waves.stable_timestep
    waves.add_impulse([0.2, -1.0, 0.1], 0.1, 0.3)
    waves.add_force([0.0, 0.3, -1.0], 0.3, 0.3)
    waves.step((STEPS // 2) * dt, substeps=STEPS // 2 + 1)
    waves.pressure = 0.01 * (atlas.positions[..., 1] > 0)
    waves.add_velocity(0.05 * atlas.positions[..., 0])
    waves.add_height(0.01 * atlas.positions[..., 1])
    waves.step((STEPS // 2) * dt)
    return [waves.height, waves.velocity, waves.dent]


@pytest.mark.parametrize("feature", FEATURES)
def test_gl_equals_cpu_after_a_thousand_steps(gl_backend: str, feature: str) -> None:
    atlas = sphere_atlas(1.0, 20)
    material = FEATURES[feature](atlas)
    pairs = zip(*(struck(atlas, material, name) for name in (gl_backend, "cpu")), strict=True)
    # the velocity shows the shortest waves, and with them the round-off, more than the height does
    for (gl, cpu), tolerance in zip(pairs, (1e-5, 1e-4, 1e-5), strict=True):
        assert np.abs(gl - cpu).max() <= tolerance * np.abs(cpu).max()


@pytest.mark.parametrize("resolution", [4, 13, 65])
def test_gl_equals_cpu_at_any_resolution(gl_backend: str, resolution: int) -> None:
    atlas = sphere_atlas(1.0, resolution)
    operator = build_operator(atlas, Material(speed=1.0, viscosity=1e-4, bending=1e-7), "fem")
    height = np.random.default_rng(resolution).standard_normal(atlas.areas.shape).astype(np.float32)

    def run(name: str) -> np.ndarray:
        backend = make_backend(name, operator)
        backend.fields.set_height(height)
        np.testing.assert_array_equal(backend.fields.height(), height)
        backend.advance(10, 0.5 / resolution)
        return backend.fields.height()

    cpu = run("cpu")
    assert np.abs(cpu - height).max() > 0.1
    assert np.abs(run(gl_backend) - cpu).max() <= 1e-5 * np.abs(cpu).max()


@pytest.mark.parametrize("operator", ["fem", "paper", "uncorrected", "dynamic-paint"])
def test_gl_equals_cpu(animal: Atlas, gl_backend: str, operator: str) -> None:
    animal = build_atlas(animal.mesh, 24)
    rng = np.random.default_rng(5)
    limits = {"speed": (0.2, 0.6), "damping": (0, 1), "stiffness": (0, 5), "density": (1, 2)}
    maps = {name: rng.uniform(*between, animal.areas.shape) for name, between in limits.items()}
    material = Material(**maps, viscosity=1e-4)

    def run(name: str) -> np.ndarray:
        waves = WaveSolver(animal, material, backend=name, operator=operator)
        waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
        waves.add_impulse(animal.mesh.V[900], 0.5, 0.1)
        waves._backend.advance(300, waves.stable_timestep)
        return waves.height

    reference = run("cpu")
    assert np.abs(reference).max() > 0
    # float32 sums in another order
    assert np.abs(run(gl_backend) - reference).max() <= 1e-5 * np.abs(reference).max()


MATERIALS = {
    "membrane": Material(speed=1.0, damping=0.3),
    "viscous plate": Material(speed=0.5, bending=1e-4, viscosity=1e-3, stiffness=4.0),
    "plastic": Material(density=2.0, yield_height=0.2, stiffness=50.0),
}


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize(
    ("texels", "rim"),
    [
        *(
            (each, "free")
            for each in (square(11), polygon(3, 8), polygon(5, 9), polygon(6, 12), flat_torus(10))
        ),
        (two_squares(7), "free"),
        (polygon(5, 12), "fixed"),
    ],
    ids=lambda each: each if isinstance(each, str) else str(each.shape),
)
def test_gl_equals_cpu_on_any_topology(
    gl_backend: str, texels: TexelMesh, rim: str, material: str
) -> None:
    atlas = texel_atlas(texels)
    heights = []
    start = np.random.default_rng(4).standard_normal(texels.shape).astype(np.float32)
    for name in ("cpu", gl_backend):
        waves = WaveSolver(atlas, MATERIALS[material], backend=name, rim=rim)
        waves.height = start
        waves.add_impulse(atlas.positions[0, 0, 0], 0.01, 0.3)
        waves.step(0.5)
        heights.append(waves.height)
    assert np.abs(heights[0] - heights[1]).max() < 1e-5 * np.abs(heights[0]).max()
    assert np.abs(heights[0] - start).max() > 0.1


@pytest.fixture
def operator() -> WaveOperator:
    return build_operator(texel_atlas(square(4)), Material(speed=1.0), "fem")


@pytest.mark.parametrize("name", ["cuda", "", "CPU"])
def test_an_unknown_backend_is_named_beside_the_valid_ones(
    operator: WaveOperator, name: str
) -> None:
    with pytest.raises(
        SolverError, match=f"backend must be one of 'auto', 'gl', 'cpu', got '{name}'"
    ):
        make_backend(name, operator)


def test_auto_takes_the_cpu_where_opengl_is_software(opengl: None, operator: WaveOperator) -> None:
    assert auto_backend() == "cpu"
    assert make_backend("auto", operator).name == "cpu"


@pytest.fixture
def hardware(computes: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> GLContext:
    """The software driver, taken for a GPU whose speed has not been measured."""
    monkeypatch.setattr(GLContext, "software", False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(backend_speed, "_SIZES", (8, 24))
    backend_speed.measured.cache_clear()
    yield shared_context()
    backend_speed.measured.cache_clear()


def test_auto_takes_the_backend_that_was_measured_to_be_faster(
    hardware: GLContext, operator: WaveOperator, monkeypatch
):
    """A GPU that takes 1 ms for any number of texels, a processor that takes 1 ms for 4,000."""
    known = backend_speed.Measured((1000.0, 8000.0), (1e-3, 1e-3), (0.25e-3, 2e-3))
    monkeypatch.setattr(backend_speed, "measure", lambda gl: known)
    assert [auto_backend(texels) for texels in (16, 3900, 4100, 10**6)] == [
        "cpu",
        "cpu",
        "gl",
        "gl",
    ]
    assert make_backend("auto", operator).name == "cpu"
    assert (
        str(known) == "1,000 texels: 1.00 ms GL, 0.25 ms CPU; 8,000 texels: 1.00 ms GL, 2.00 ms CPU"
    )


def test_a_machine_is_measured_once(hardware: GLContext, monkeypatch: pytest.MonkeyPatch) -> None:
    first = backend_speed.measured(hardware)
    assert first.texels == (384.0, 3456.0)
    assert min(first.gl + first.cpu) > 0
    backend_speed.measured.cache_clear()  # as another process does
    monkeypatch.setattr(backend_speed, "measure", lambda gl: pytest.fail("measured twice"))
    assert backend_speed.measured(hardware) == first
    assert auto_backend(10**6) == first.faster(10**6)


def test_without_opengl_auto_takes_the_cpu_and_gl_is_an_error(
    operator: WaveOperator, monkeypatch: pytest.MonkeyPatch
):
    def fail(device: int | None) -> None:
        raise GLError("no OpenGL 4.3 context")

    # contexts of earlier tests, and a device that an earlier test selected, must not count
    monkeypatch.setattr(context, "create_context", fail)
    monkeypatch.setattr(context, "_shared", {})
    monkeypatch.setattr(context, "_selected", None)
    assert make_backend("auto", operator).name == "cpu"
    with pytest.raises(GLError, match=r"no OpenGL 4\.3"):
        make_backend("gl", operator)


def test_a_new_backend_is_at_rest_and_stays_there(operator: WaveOperator, backend: str) -> None:
    waves = make_backend(backend, operator)
    assert waves.name == backend
    waves.advance(3, 0.01)
    waves.wait()
    assert waves.finite()
    fields = waves.fields
    for field in (fields.height(), waves.velocity(), fields.permanent_height()):
        assert field.dtype == np.float32 and field.shape == (1, 4, 4) and not field.any()
