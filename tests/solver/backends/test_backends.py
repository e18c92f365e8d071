"""The two backends against each other, feature by feature."""

import numpy as np
import pytest
from features import FEATURES

from ripple_sim.solver import Atlas, Material, WaveSolver, build_atlas, sphere_atlas
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.operator.assembly import build_operator

STEPS = 1000


def struck(atlas: Atlas, material: Material, backend: str) -> list[np.ndarray]:
    """Height, velocity and dent after an impulse, a held force and pressure, and a velocity and a height added."""
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
        backend.set_height(height)
        np.testing.assert_array_equal(backend.height(), height)
        backend.advance(10, 0.5 / resolution)
        return backend.height()

    cpu = run("cpu")
    assert np.abs(cpu - height).max() > 0.1
    assert np.abs(run(gl_backend) - cpu).max() <= 1e-5 * np.abs(cpu).max()


@pytest.mark.parametrize("operator", ["fem", "paper", "uncorrected", "dynamic-paint"])
def test_gl_equals_cpu(animal: Atlas, gl_backend: str, operator: str) -> None:
    animal = build_atlas(animal.mesh, 24)
    rng = np.random.default_rng(5)
    shape = animal.areas.shape
    material = Material(
        speed=rng.uniform(0.2, 0.6, shape),
        damping=rng.uniform(0, 1, shape),
        stiffness=rng.uniform(0, 5, shape),
        viscosity=1e-4,
        density=rng.uniform(1, 2, shape),
    )

    def run(name: str) -> np.ndarray:
        waves = WaveSolver(animal, material, backend=name, operator=operator)
        waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
        waves.add_impulse(animal.mesh.V[900], 0.5, 0.1)
        waves._backend.advance(1000, waves.stable_timestep)
        return waves.height

    reference = run("cpu")
    assert np.abs(reference).max() > 0
    assert np.abs(run(gl_backend) - reference).max() <= 1e-5 * np.abs(reference).max()
