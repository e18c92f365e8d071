"""The rivals compute what the solver computes: otherwise their speed would say nothing."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rivals import NaiveLoop, PlainShader, SparseLeapfrog

from ripple_sim.solver import Material, sphere_atlas
from ripple_sim.solver.backends import make_backend
from ripple_sim.solver.operator import WaveOperator, build_operator

N = 16
SUBSTEPS = 41
ROUND_OFF = 1e-5  # of the peak, after that many substeps in float32

START = np.random.default_rng(0).standard_normal((6, N, N)).astype(np.float32)
RIVALS: dict[str, Callable[[WaveOperator], Any]] = {
    "naive loop": NaiveLoop,
    "naive loop, prange": lambda operator: NaiveLoop(operator, parallel=True),
    "sparse matrix": SparseLeapfrog,
    "plain shader": PlainShader,
}


@pytest.fixture(scope="module")
def operator() -> WaveOperator:
    # speed and density differ from 1 and from texel to texel, so that no factor can be left out
    # unseen
    z = sphere_atlas(1.0, N).positions[..., 2]
    return build_operator(sphere_atlas(1.0, N), Material(speed=2.0 + z, density=3.0 - z), "fem")


@pytest.mark.parametrize("name", RIVALS)
def test_rival_follows_the_backend(
    name: str, operator: WaveOperator, request: pytest.FixtureRequest
) -> None:
    if name == "plain shader":
        request.getfixturevalue("opengl")
    rival = RIVALS[name](operator)
    solver = make_backend("cpu", operator)
    rival.set_height(START)
    solver.fields.set_height(START)
    dt = 0.7 * operator.stable_timestep
    # the solver drifts half a step before each kick and half a step after: the first half moves
    # nothing, at a velocity of 0, and the rival, which drifts a whole step after each kick, is
    # taken back by the last half
    rival.advance(SUBSTEPS, dt)
    solver.advance(SUBSTEPS, dt)
    height, velocity = rival.state()
    assert (
        np.abs(height - dt / 2 * velocity - solver.fields.height()).max()
        < ROUND_OFF * np.abs(START).max()
    )
    assert np.abs(velocity - solver.fields.velocity()).max() < ROUND_OFF * np.abs(velocity).max()
