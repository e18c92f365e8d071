"""The two backends against each other, feature by feature, and threads against one thread."""

from collections.abc import Callable

import numpy as np
import pytest

from ripple_sim.solver import Atlas, Material, WaveSolver, sphere_atlas
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.backends.cpu import CPUBackend
from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.operator.assembly import build_operator

STEPS = 1000


def north(atlas: Atlas) -> np.ndarray:
    return atlas.positions[..., 2] > 0.3


FEATURES: dict[str, Callable[[Atlas], Material]] = {
    "plain": lambda atlas: Material(speed=1.0),
    "damping and density maps": lambda atlas: Material(
        speed=1.0, damping=0.3 * north(atlas), density=1.0 + north(atlas)
    ),
    "speed map": lambda atlas: Material(speed=1.0 + 0.5 * atlas.positions[..., 0]),
    "reflecting region": lambda atlas: Material(speed=1.0 * ~north(atlas)),
    "fixed": lambda atlas: Material(speed=1.0, fixed=north(atlas)),
    "viscosity": lambda atlas: Material(speed=1.0, viscosity=1e-3),
    "bending and viscosity": lambda atlas: Material(speed=0.5, bending=1e-4, viscosity=1e-3),
    "yield map": lambda atlas: Material(speed=1.0, yield_height=np.where(north(atlas), 5e-3, np.inf), stiffness=10.0),
}


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


@pytest.mark.parametrize("software", [True, False], ids=["software blocks", "hardware blocks"])
@pytest.mark.parametrize("resolution", [4, 5, 13, 63, 65, 130])
def test_gl_equals_cpu_at_resolutions_that_fill_no_strip(
    gl_backend: str, monkeypatch: pytest.MonkeyPatch, resolution: int, software: bool
) -> None:
    monkeypatch.setattr(GLContext, "software", software)
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


@pytest.mark.parametrize("feature", ["plain", "damping and density maps", "fixed"])
def test_threads_change_no_bit(feature: str) -> None:
    atlas = sphere_atlas(1.0, 20)
    operator = build_operator(atlas, FEATURES[feature](atlas), "fem")
    start = np.random.default_rng(3).standard_normal(atlas.areas.shape).astype(np.float32)
    loaded = np.flatnonzero(operator.movable)[:40]

    def run(threads: int) -> bytes:
        backend = CPUBackend(operator, threads)
        backend.set_height(start)
        for substeps in (1, 7, 20):
            backend.load(loaded, np.linspace(-1, 1, 40), 0.01)
            backend.kick(loaded, np.ones(40, np.float32), -0.02)
            backend.advance(substeps, operator.stable_timestep)
        return backend.height().tobytes() + backend.velocity().tobytes()

    assert run(1) == run(2) == run(6)
