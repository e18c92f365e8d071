"""Operators by name, the baselines, and softened needles."""

import dataclasses

import numpy as np
import pytest
from modes import mode_error

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.operator.assembly import softening, source_grip


def test_baselines_do_not_converge() -> None:
    # the figures measured when the project was designed: 0.125 at every resolution
    for n in (32, 64):
        assert mode_error(n, "paper") == pytest.approx(0.125, abs=0.005)


def test_needles_do_not_set_the_time_step_of_all() -> None:
    ball = sphere_atlas(1.0, 32)
    assert (softening(ball.texels) == 1).all()
    positions = ball.positions.copy()
    # nine texels almost in one place
    crowd = positions[4, 9:12, 9:12]
    crowd += 0.8 * (crowd[1, 1] - crowd)
    needles = dataclasses.replace(ball, texels=ball.texels.with_positions(positions, normals=ball.normals))
    factors = softening(needles.texels)
    assert 1 <= (factors < 1).sum() <= 9
    assert factors.min() < 0.3
    steps = [WaveSolver(atlas, backend="cpu").stable_timestep for atlas in (ball, needles)]
    assert steps[1] > 0.9 * steps[0]


def test_unknown_names_list_the_valid_ones() -> None:
    atlas = sphere_atlas(1.0, 8)
    with pytest.raises(SolverError, match="'auto', 'gl', 'cpu'"):
        WaveSolver(atlas, backend="cuda")
    with pytest.raises(SolverError, match="'fem', 'paper'"):
        WaveSolver(atlas, backend="cpu", operator="spectral")
    with pytest.raises(SolverError, match="the atlas needs"):
        WaveSolver(atlas, Material(speed=np.ones((6, 16, 16))), backend="cpu")


def test_sources_lose_their_grip_as_all_that_pulls_back_fades() -> None:
    squares = np.array([[[1.0, 2e-3], [5e-4, 0.0]]])
    none = np.zeros_like(squares)
    np.testing.assert_allclose(source_grip(squares, none, none), [[[1, 1], [0.5, 0]]])
    # a spring or resistance to bending is a pull as well
    assert source_grip(squares, none + 3.0, none) is None
    assert source_grip(none, none, none) is None


def test_a_load_on_a_map_that_fades_to_zero_does_not_sink_in_for_ever(backend: str) -> None:
    atlas = sphere_atlas(1.0, 24)
    fading = np.clip(1 - 2 * atlas.positions[..., 2], 0, 1) ** 4
    waves = WaveSolver(atlas, Material(speed=fading, damping=5.0), backend=backend)
    waves.add_force([0.9, 0, 0.45], 1.0, 0.2)
    waves.step(20.0)
    deepest = np.abs(waves.height)
    usual = WaveSolver(atlas, Material(damping=5.0), backend=backend)
    usual.add_force([0.9, 0, 0.45], 1.0, 0.2)
    usual.step(20.0)
    assert not deepest[fading == 0].any()
    assert deepest.max() < 100 * np.abs(usual.height).max()
