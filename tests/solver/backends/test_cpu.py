"""The CPU backend against whole matrices in double precision, and what it conserves."""

import itertools

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square, two_squares

from ripple_sim.solver import Material, TexelMesh, sphere_atlas, texel_atlas
from ripple_sim.solver.backends import CPUBackend, TexelLoad, advance
from ripple_sim.solver.backends.probes import Probes
from ripple_sim.solver.operator import WaveOperator, build_operator
from ripple_sim.solver.texels import stiffness_matrix


class DenseWaves:
    """Height, velocity and dent [texels], and leapfrog substeps of a wave operator."""

    def __init__(self, operator: WaveOperator, height: np.ndarray, velocity: np.ndarray) -> None:
        self._operator = operator
        self.h = height.ravel().astype(float)
        self.v = velocity.ravel().astype(float)
        self.dent = np.zeros_like(self.h)
        self.forces = np.zeros_like(self.h)
        self.acceleration = 0.0
        size = len(self.h)
        self._tension, self._viscosity = (
            np.zeros((size, size)) if stencil is None else -stiffness_matrix(stencil).toarray()
            for stencil in (operator.stencil, operator.viscosity_stencil)
        )
        self._bending = (
            np.zeros((size, size))
            if operator.bending is None
            else operator.bending.stiffness.toarray()
        )

    def advance(self, substeps: int, dt: float) -> None:
        operator = self._operator
        half = operator.damping.ravel() * dt / 2
        span = dt / (1 + half)
        gain = span / operator.mass.ravel() * operator.free.ravel()
        self.h += dt / 2 * self.v
        self._flow()
        for step in range(substeps):
            force = self._tension @ self.h + self._viscosity @ self.v - self._bending @ self.h
            self.v = (
                (1 - half) / (1 + half) * self.v
                + gain * (force + self.forces)
                - span * operator.stiffness.ravel() * self.h
                + span * operator.response.ravel() * self.acceleration
            )
            self.h += (dt if step < substeps - 1 else dt / 2) * self.v
            self._flow()

    def _flow(self) -> None:
        if self._operator.yield_height is not None:
            most = self._operator.yield_height.ravel()
            kept = np.clip(self.h, -most, most)
            self.dent += self.h - kept
            self.h = kept


MESHES = {
    "square": square(5),
    "four texels": square(2),
    "corner of three": polygon(3, 4),
    "corner of five": polygon(5, 3),
    "torus": flat_torus(6),
    "two squares": two_squares(3),
    "fixed rim": polygon(3, 4).with_fixed_rim(),
}


def ramp(texels: TexelMesh) -> np.ndarray:
    return np.linspace(0.5, 1.5, texels.areas.size).reshape(texels.shape)


MATERIALS = {
    "plain": lambda x: Material(speed=1.0),
    "maps": lambda x: Material(
        speed=ramp(x), damping=2 * ramp(x), stiffness=5 * ramp(x), density=ramp(x)[:, ::-1]
    ),
    "viscous plate": lambda x: Material(speed=0.5, bending=1e-3, viscosity=1e-2, damping=0.5),
    "plate alone": lambda x: Material(speed=0.0, bending=1e-3 * ramp(x)),
    "yields, partly fixed": lambda x: Material(
        1.0, stiffness=3.0, yield_height=0.4 * ramp(x), fixed=ramp(x) > 1.3
    ),
}


def operator_of(texels: TexelMesh, material: Material) -> WaveOperator:
    return build_operator(texel_atlas(texels), material, "fem")


def noise(texels: TexelMesh, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(texels.shape).astype(np.float32)


def started(operator: WaveOperator, height: np.ndarray, velocity: np.ndarray) -> CPUBackend:
    backend = CPUBackend(operator)
    backend.fields.set_height(height)
    backend.set_velocity(velocity)
    return backend


def step_of(operator: WaveOperator) -> float:
    return min(0.5 * operator.stable_timestep, 0.05)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("substeps", [1, 6])
def test_waves_equal_those_of_dense_matrices(mesh: str, material: str, substeps: int) -> None:
    texels = MESHES[mesh]
    operator = operator_of(texels, MATERIALS[material](texels))
    height = noise(texels, 1) * operator.free
    velocity = noise(texels, 2) * operator.free
    dense = DenseWaves(operator, height, velocity)
    backend = started(operator, height, velocity)
    loaded = np.unique([0, texels.areas.size // 2])
    dense.forces[loaded] = 0.3
    dense.acceleration = -0.7
    backend.hold(TexelLoad(loaded, np.full(len(loaded), 0.3), -0.7))
    for _ in range(2):
        for waves in (dense, backend):
            waves.advance(substeps, step_of(operator))
    expected = [(dense.h + dense.dent), dense.v, dense.dent]
    for now, then in zip(
        (backend.fields.height(), backend.velocity(), backend.fields.permanent_height()),
        expected,
        strict=True,
    ):
        np.testing.assert_allclose(now.ravel(), then, atol=2e-5 * max(1.0, np.abs(then).max()))


def test_few_loops_are_compiled_for_all_materials() -> None:
    texels = MESHES["torus"]
    maps = (0.0, 1.0, ramp(texels))
    before = len(advance.signatures)
    for damping, stiffness, density, bending in itertools.product(
        maps, maps, maps[1:], (0.0, 1e-3)
    ):
        material = Material(
            speed=1.0, damping=damping, stiffness=stiffness, density=density, bending=bending
        )
        operator = operator_of(texels, material)
        for keeps_volume in (False, True):
            CPUBackend(operator, keeps_volume=keeps_volume).advance(1, step_of(operator))
    assert len(advance.signatures) <= before + 5


def test_waves_without_damping_run_back_to_where_they_came_from() -> None:
    texels = MESHES["corner of five"]
    operator = operator_of(texels, Material(speed=1.0, stiffness=2.0, bending=1e-3))
    height = noise(texels, 4)
    velocity = noise(texels, 5)
    backend = started(operator, height, velocity)
    dt = step_of(operator)
    backend.advance(50, dt)
    assert np.abs(backend.fields.height() - height).max() > 0.5
    backend.set_velocity(-backend.velocity())
    backend.advance(50, dt)
    np.testing.assert_allclose(backend.fields.height(), height, atol=2e-4)
    np.testing.assert_allclose(backend.velocity(), -velocity, atol=2e-3)


def test_a_velocity_that_is_set_replaces_kicks_that_wait() -> None:
    texels = MESHES["square"]
    backend = started(operator_of(texels, Material(speed=1.0)), noise(texels, 8), noise(texels, 8))
    backend.kick(np.array([2]), np.array([5.0], np.float32), 3.0)
    backend.set_velocity(noise(texels, 9))
    np.testing.assert_array_equal(backend.velocity(), noise(texels, 9))


@pytest.mark.parametrize("material", ["plain", "yields, partly fixed"])
def test_reading_shows_copies_and_changes_nothing(material: str) -> None:
    texels = MESHES["square"]
    operator = operator_of(texels, MATERIALS[material](texels))
    backend = started(operator, 0.1 * noise(texels, 1), noise(texels, 2))
    backend.kick(np.array([0]), np.array([1.0], np.float32), 0.5)
    before = [
        backend.fields.height().copy(),
        backend.velocity().copy(),
        backend.fields.permanent_height().copy(),
    ]
    for read in (backend.fields.height, backend.velocity, backend.fields.permanent_height):
        read()[:] = np.nan
    for now, then in zip(
        [backend.fields.height(), backend.velocity(), backend.fields.permanent_height()],
        before,
        strict=True,
    ):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("texel", [(0, 0, 0), (4, 2, 2)])
def test_one_height_that_is_no_number_is_noticed(
    poison: float, texel: tuple[int, int, int]
) -> None:
    texels = MESHES["corner of five"]
    backend = CPUBackend(operator_of(texels, Material(speed=1.0)))
    height = noise(texels, 1)
    backend.fields.set_height(height)
    assert backend.finite()
    height[texel] = poison
    backend.fields.set_height(height)
    assert not backend.finite()


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("mesh", MESHES)
def test_any_number_of_threads_gives_the_same_bits(mesh: str, material: str) -> None:
    texels = MESHES[mesh]
    operator = operator_of(texels, MATERIALS[material](texels))
    probes = Probes(
        begins=np.array([0, 2]),
        texels=np.array([0, texels.areas.size - 1]),
        weights=np.array([0.5, 2.0], np.float32),
        heights=np.array([True]),
    )
    results = []
    for threads in (1, 2, 3, 8):
        backend = CPUBackend(operator, threads=threads)
        backend.fields.set_height(noise(texels, 1) * operator.free)
        backend.set_velocity(noise(texels, 2) * operator.free)
        loaded = np.array([0, texels.areas.size - 1])
        backend.hold(TexelLoad(loaded, np.array([0.3, -0.2]), -0.7))
        backend.probe(probes)
        backend.advance(7, step_of(operator))
        backend.probe(None)
        backend.advance(4, step_of(operator))
        fields = backend.fields
        heights = [fields.height(), fields.permanent_height()]
        results.append([*heights, backend.velocity(), backend.probed()])
    for result in results[1:]:
        for values, expected in zip(result, results[0], strict=True):
            np.testing.assert_array_equal(values, expected)


def test_a_surface_at_rest_begins_with_any_push() -> None:
    operator = build_operator(sphere_atlas(1.0, 8), Material(stiffness=1.0), "fem")
    one = np.ones(1, np.int64)
    pushes = {
        "kick": lambda waves: waves.kick(one, np.ones(1, np.float32), 0.0),
        "kick of all": lambda waves: waves.kick(one[:0], np.ones(0, np.float32), 1.0),
        "force": lambda waves: waves.hold(TexelLoad(one, np.ones(1), 0.0)),
        "pressure": lambda waves: waves.hold(TexelLoad(one[:0], np.ones(0), 1.0)),
        "height": lambda waves: waves.fields.set_height(np.ones((6, 8, 8), np.float32)),
        "velocity": lambda waves: waves.set_velocity(np.ones((6, 8, 8), np.float32)),
    }
    for name, push in pushes.items():
        backend = CPUBackend(operator)
        backend.advance(3, 1e-3)
        assert not backend.fields.height().any()
        push(backend)
        before = backend.fields.height()
        backend.advance(3, 1e-3)
        assert (backend.fields.height() != before).any(), name
