"""Operators by name, the baselines, and softened needles."""

import dataclasses

import numpy as np
import pytest
from modes import mode_error

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.operator.assembly import softening


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
