"""Rigid and clamped regions reflect waves, and absorbing regions absorb them."""

import numpy as np
import pytest
from modes import zonal_harmonic

from ripple_sim.solver import (
    Atlas,
    Material,
    SolverError,
    WaveSolver,
    absorbing_damping,
    sphere_atlas,
)
from ripple_sim.solver.operator import hold


def after_one_period(
    n: int, material: Material, mode: np.ndarray, eigenvalue: float, backend: str = "cpu"
) -> float:
    """Relative L2 error of a mode after one period, on the northern hemisphere."""
    atlas = sphere_atlas(1.0, n)
    waves = WaveSolver(atlas, material, backend=backend)
    waves.height = mode
    waves.step(2 * np.pi / np.sqrt(eigenvalue))
    weight = atlas.areas * (atlas.positions[..., 2] > 0)
    return float(np.sqrt((weight * (waves.height - mode) ** 2).sum() / (weight * mode**2).sum()))


def test_a_hemisphere_with_a_free_rim_has_the_even_modes() -> None:
    # c = 0 below the equator: on the other side only modes with no slope at the equator are left,
    # as on a whole sphere
    zonal = {}
    tesseral = {}
    for n in (32, 64):
        x, y, z = np.moveaxis(sphere_atlas(1.0, n).positions, -1, 0)
        material = Material(speed=np.where(z > 0, 1.0, 0.0))
        zonal[n] = after_one_period(n, material, zonal_harmonic(z), 20)
        tesseral[n] = after_one_period(n, material, (x**2 - y**2) * (7 * z**2 - 1), 20)
    # the rim is a staircase of texels: the mode that varies along it converges with first order
    assert zonal[64] < 1e-3
    assert zonal[64] < zonal[32] / 3
    assert tesseral[64] < 0.015
    assert tesseral[64] < tesseral[32] / 1.8


def test_a_hemisphere_with_a_clamped_rim_has_the_odd_modes(backend: str) -> None:
    for n in (32, 64):
        z = sphere_atlas(1.0, n).positions[..., 2]
        # the clamp acts at texel centres: the rim is half a texel below the equator
        error = after_one_period(
            n, Material(fixed=z < 0), np.where(z > 0, (5 * z**3 - 3 * z) / 2, 0), 12, backend
        )
        assert error < 2.4 / n


@pytest.mark.parametrize("kind", ["rigid", "fixed"])
def test_a_pulse_is_reflected_with_all_its_energy_and_the_right_sign(kind: str) -> None:
    atlas = sphere_atlas(1.0, 96)
    angle = np.arccos(np.clip(atlas.positions[..., 2], -1, 1))
    below = angle > 2.0
    materials = {
        "rigid": Material(speed=np.where(below, 0.0, 1.0)),
        "fixed": Material(fixed=below),
    }
    waves = WaveSolver(atlas, materials[kind], backend="cpu")
    # a ring on its way to the south: height f(angle - t) in the plane wave's limit
    pulse = np.exp(-(((angle - 1.2) / 0.12) ** 2))
    waves.height = pulse
    waves.velocity = 2 * (angle - 1.2) / 0.12**2 * pulse
    waves.step(0.8)
    energy = waves.energy()
    waves.step(0.8)
    assert waves.energy() == pytest.approx(energy, rel=1e-5)
    assert np.abs(waves.height[angle > 2.05]).max() < 1e-15
    # back at 1.2, on its way north: like a pulse on a rope, which keeps its sign at a free end and
    # changes it at a clamped end
    ring = np.abs(angle - 1.2) < 0.05
    peak = waves.height[ring].mean() / pulse[ring].mean()
    assert peak == pytest.approx(1.0 if kind == "rigid" else -1.0, abs=0.1)


def test_sources_do_not_move_rigid_and_clamped_texels(animal: Atlas, backend: str) -> None:
    calm = animal.positions[..., 2] > 0.05
    fixed = animal.positions[..., 0] > 0.1
    waves = WaveSolver(
        animal,
        Material(speed=np.where(calm, 0.0, 0.5), viscosity=1e-3, fixed=fixed),
        backend=backend,
    )
    rng = np.random.default_rng(1)
    for vertex in rng.integers(0, len(animal.mesh.V), 40):
        waves.add_impulse(animal.mesh.V[vertex], 1.0, 0.05)
    waves.add_force(animal.mesh.V[3], 1.0, 0.05)
    waves.step(1.0)
    assert np.abs(waves.height).max() > 0
    assert not waves.height[calm | fixed].any()
    assert not waves.velocity[calm | fixed].any()


def held_cap(n: int, kind: str) -> tuple[WaveSolver, np.ndarray]:
    """A pulse on its way to a held cap, and the angle of each texel from the cap's middle.

    The middle is a point without symmetry of the texels.
    """
    atlas = sphere_atlas(1.0, n)
    center = np.array([0.36, -0.48, 0.8])
    angle = np.arccos(np.clip(atlas.positions @ center, -1, 1))
    cap = angle < 1.0
    materials = {
        "held": hold(atlas, Material(), cap),
        "clamped": Material(fixed=cap),
        "free": Material(1.0 * ~cap),
    }
    waves = WaveSolver(atlas, materials[kind], backend="cpu")
    pulse = np.exp(-(((angle - 1.8) / 0.12) ** 2))
    waves.height = pulse
    waves.velocity = -2 * (angle - 1.8) / 0.12**2 * pulse
    return waves, angle


def test_held_region_reflects_all_energy_inverted() -> None:
    waves, angle = held_cap(96, "held")
    waves.step(0.8)
    energy = waves.energy()
    assert not waves.height[angle < 0.97].any()
    waves.step(0.8)
    assert waves.energy() == pytest.approx(energy, rel=1e-5)
    # back at 1.8 and inverted; the rim is up to two texels wide, and the pulse crosses it twice
    around = np.arange(1.6, 2.0, 0.01)
    rings = [waves.height[np.abs(angle - middle) < 0.01].mean() for middle in around]
    assert min(rings) == pytest.approx(-1, abs=0.06)
    assert around[np.argmin(rings)] == pytest.approx(1.8, abs=4 * np.pi / 2 / 96)


def test_rim_of_a_held_region_is_smooth() -> None:
    unevenness = {}
    for kind in ("held", "clamped", "free"):
        waves, angle = held_cap(64, kind)
        waves.step(0.7)
        # effect of the texels' staircase on a round wave: height about the rim, less its mean at
        # the same distance
        rim = np.abs(angle - 1.06) < 0.08
        distance = angle[rim] - 1.0
        height = waves.height[rim]
        mean = np.polyval(np.polyfit(distance, height, 8), distance)
        unevenness[kind] = np.std(height - mean) / np.abs(waves.height).max()
    assert unevenness["held"] < 0.015
    assert unevenness["held"] < 0.6 * unevenness["clamped"]
    assert unevenness["held"] < 0.15 * unevenness["free"]


def test_a_held_region_keeps_the_time_step_and_never_moves(animal: Atlas) -> None:
    region = animal.positions[..., 2] > 0.05
    free = WaveSolver(animal, Material(speed=0.5), backend="cpu")
    held = WaveSolver(animal, hold(animal, Material(speed=0.5), region), backend="cpu")
    assert held.stable_timestep > 0.93 * free.stable_timestep
    inside = animal.positions[held.operator.fixed]
    held.add_impulse(inside[np.argmax(inside[:, 2])], 1.0, 0.01)
    held.step(0.2)
    assert not held.height.any()
    with pytest.raises(SolverError, match="from 0 to 1"):
        hold(animal, Material(), 2.0 * region)
    with pytest.raises(SolverError, match="shape"):
        hold(animal, Material(), region[:, :5])


@pytest.mark.parametrize("backend", ["cpu", "gl"])
def test_a_surface_that_is_wholly_held_is_legal_and_does_not_move(
    backend: str, opengl: None
) -> None:
    atlas = sphere_atlas(1.0, 8)
    waves = WaveSolver(atlas, Material(fixed=np.ones(atlas.areas.shape, bool)), backend=backend)
    waves.add_impulse([1.0, 0.0, 0.0], 1.0, 0.3)
    waves.step(0.01)
    assert not waves.height.any()
    assert not waves.velocity.any()


def test_an_absorbing_cap_absorbs_a_pulse() -> None:
    atlas = sphere_atlas(1.0, 64)
    angle = np.arccos(np.clip(atlas.positions[..., 2], -1, 1))
    goal = 1e-2
    # kinetic energy outside the cap when the pulse is back where it began; half of a wave's energy
    # is kinetic
    energies = {}
    graded = absorbing_damping(atlas, angle > 2.0, speed=1.0, reflection=goal)
    for kind, damping in (
        ("none", 0.0),
        ("graded", graded),
        ("abrupt", np.where(angle > 2.0, 200.0, 0.0)),
    ):
        waves = WaveSolver(atlas, Material(damping=damping), backend="cpu")
        pulse = np.exp(-(((angle - 1.2) / 0.12) ** 2))
        waves.height = pulse
        waves.velocity = 2 * (angle - 1.2) / 0.12**2 * pulse
        start = waves.energy()
        waves.step(2 * (np.pi - 1.2))
        moving = (waves.operator.mass * waves.velocity**2)[angle < 2.0].sum()
        energies[kind] = moving / start
    assert energies["none"] > 0.9
    assert np.sqrt(energies["graded"]) < 2.5 * goal
    # a wall of strong damping reflects
    assert energies["abrupt"] > 100 * energies["graded"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"region": np.zeros((6, 8, 8), bool)}, "some texels and not all, got 0 of 384"),
        ({"region": np.ones((6, 8, 8), bool)}, "some texels and not all, got 384 of 384"),
        ({"region": np.zeros((6, 8, 8))}, "float64"),
        ({"reflection": 1.5}, "reflection must be .*, got 1.5"),
        ({"speed": 0.0}, "speed must be .*, got 0.0"),
        ({"width": -1.0}, "width must be .*, got -1.0"),
    ],
)
def test_invalid_absorbers_are_refused(arguments: dict, message: str) -> None:
    atlas = sphere_atlas(1.0, 8)
    with pytest.raises(SolverError, match=message):
        absorbing_damping(
            atlas, **({"region": atlas.positions[..., 2] > 0, "speed": 1.0} | arguments)
        )
