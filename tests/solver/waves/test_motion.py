"""Waves on moving surfaces: an ordinary equation, rigid motion, mass, and folds."""

import copy
import pickle

import numpy as np
import pytest
from hand_made import square
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.errors import RippleWarning

ATLAS = sphere_atlas(1.0, 8)
Z = ATLAS.positions[..., 2]


def breathing_error(resolution: int, tightening: float) -> float:
    """Relative error of mode Y_20 on a sphere of radius a(t), the largest of about a period."""
    atlas = sphere_atlas(1.0, resolution)
    mode = (3 * atlas.positions[..., 2] ** 2 - 1) / 2
    waves = WaveSolver(atlas, Material(speed=1.0, tightening=tightening), backend="cpu")
    waves.height = mode
    steps = 12 * resolution
    end = 3.0

    def radius(t):
        return 1 + 0.3 * np.sin(2 * t)

    def change(t, y):
        return [y[1], -6 * radius(t) ** (2 * tightening - 2) * y[0]]

    times = np.linspace(0, end, steps + 1)[1:]
    exact = solve_ivp(change, (0, end), [1, 0], t_eval=times, rtol=1e-9, atol=1e-12)
    errors = []
    for i, height in enumerate(exact.y[0]):
        waves.move(atlas.mesh.V * radius((i + 0.5) * end / steps))
        waves.step(end / steps)
        errors.append(np.linalg.norm(waves.height - height * mode))
    return float(max(errors) / np.linalg.norm(mode))


@pytest.mark.parametrize("tightening", [0.0, 2.0], ids=["even", "tight"])
def test_a_breathing_sphere_follows_its_differential_equation_to_second_order(tightening):
    coarse, fine = (breathing_error(n, tightening) for n in (8, 16))
    assert fine < 6e-3
    assert coarse / fine > 3.6


def test_both_backends_move_alike():
    bends = Material(speed=1.0, viscosity=1e-3, bending=1e-3, density=2.0)
    heights = []
    for backend in ("cpu", "gl"):
        waves = WaveSolver(ATLAS, bends, backend=backend)
        waves.height = Z**3
        for i in range(5):
            waves.move(ATLAS.mesh.V * [1 + 0.05 * i, 1, 1 - 0.05 * i])
            waves.step(0.02)
        heights.append(waves.height)
    assert_allclose(*heights, atol=2e-6)


def test_rigid_motion_leaves_heights_and_energy_as_they_are():
    still, moved = (WaveSolver(ATLAS, Material(speed=1.0), backend="cpu") for _ in range(2))
    for waves in (still, moved):
        waves.add_impulse([0, 0, 1], 1.0, 0.3)
    for i in range(100):
        turn = np.array([[np.cos(i), np.sin(i), 0], [-np.sin(i), np.cos(i), 0], [0, 0, 1]])
        moved.move(ATLAS.mesh.V @ turn + [0.1 * i, 0, 0])
        for waves in (still, moved):
            waves.step(0.03)
    assert_allclose(moved.height, still.height, atol=1e-5 * np.abs(still.height).max())
    assert moved.energy() == pytest.approx(still.energy(), rel=1e-5)
    assert_allclose(moved.atlas.positions, ATLAS.positions @ turn + [0.1 * i, 0, 0], atol=1e-12)
    assert_allclose(moved.atlas.normals, ATLAS.normals @ turn, atol=0.05)


def test_wild_motion_keeps_mass_and_momentum_and_stays_finite():
    waves = WaveSolver(
        ATLAS, Material(speed=1.0, density=3.0), backend="cpu", conserve_volume=False
    )
    mass = waves.operator.mass.copy()
    rates = np.array([1.0, 1.3, 0.7])
    waves.add_impulse([0, 0, 1], 1.0, 0.3)
    for i in range(200):
        waves.move(ATLAS.mesh.V * (1 + 0.4 * np.sin(0.07 * i * rates)))
        waves.step(0.05)
    assert (waves.operator.mass == mass).all()
    assert waves.momentum() == pytest.approx(-1.0, abs=1e-5)
    assert np.isfinite(waves.height).all()


def test_folded_triangles_give_a_warning_and_no_nan():
    atlas = texel_atlas(square(8))
    waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
    waves.add_impulse(atlas.positions[0, 3, 3], 1.0, 0.2)
    folded = atlas.mesh.V.copy()
    folded[10] += folded[15] - folded[8]
    with pytest.warns(RippleWarning, match="triangles of the moving surface are turned over"):
        waves.move(folded)
    waves.step(0.05)
    waves.move(0 * folded)
    waves.step(1e-4)
    assert np.isfinite(waves.height).all()


def test_copies_continue_like_the_original():
    waves = WaveSolver(ATLAS, Material(speed=1.0), backend="cpu")
    waves.add_impulse([0, 0, 1], 1.0, 0.3)
    waves.move(ATLAS.mesh.V * [1, 1, 1.5])
    copies = copy.copy(waves), copy.deepcopy(waves), pickle.loads(pickle.dumps(waves))
    for each in (waves, *copies):
        each.move(ATLAS.mesh.V * [1, 1, 1.6])
        each.step(0.05)
    for each in copies:
        assert (each.height == waves.height).all()


def test_vertices_that_do_not_fit_are_refused():
    waves = WaveSolver(ATLAS, Material(speed=1.0))
    with pytest.raises(SolverError, match=r"vertices have shape \(3, 3\); the mesh"):
        waves.move(np.zeros((3, 3)))
    with pytest.raises(SolverError, match=r"vertices must be finite .*, got 1 numbers"):
        waves.move(np.where(np.arange(ATLAS.mesh.V.size).reshape(-1, 3) == 4, np.nan, ATLAS.mesh.V))
    with pytest.raises(SolverError, match="deep fluid"):
        WaveSolver(ATLAS, Material.water()).move(ATLAS.mesh.V)
    with pytest.raises(SolverError, match="must have the operator 'fem', got 'paper'"):
        WaveSolver(ATLAS, Material(speed=1.0), operator="paper").move(ATLAS.mesh.V)
    with pytest.raises(SolverError, match=r"tightening must be .*, got 9"):
        Material(tightening=9.0)
