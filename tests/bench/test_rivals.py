"""The rivals compute what the solver computes: otherwise their speed would say nothing.

The memory bound moves what a substep moves, once.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ripple_sim.bench.rivals import READS, WRITES, MemoryStream, NaiveLoop, PlainShader, SparseLeapfrog
from ripple_sim.solver import GLError, Material, sphere_atlas
from ripple_sim.solver.backends.backend import make_backend
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator

N, SUBSTEPS = 16, 41
ROUND_OFF = 1e-5  # of the peak, after that many substeps in float32

RIVALS: dict[str, Callable[[WaveOperator], Any]] = {
    "naive loop": NaiveLoop,
    "naive loop, prange": lambda operator: NaiveLoop(operator, parallel=True),
    "sparse matrix": SparseLeapfrog,
    "plain shader": PlainShader,
}


@pytest.fixture(scope="module")
def operator() -> WaveOperator:
    # speed and density differ from 1 and from texel to texel, so that no factor can be left out unseen
    z = sphere_atlas(1.0, N).positions[..., 2]
    return build_operator(sphere_atlas(1.0, N), Material(speed=2.0 + z, density=3.0 - z), "fem")


@pytest.mark.parametrize("name", RIVALS)
def test_rival_follows_the_backend(name: str, operator: WaveOperator) -> None:
    start = np.random.default_rng(0).standard_normal((6, N, N)).astype(np.float32)
    try:
        rival = RIVALS[name](operator)
    except GLError as error:
        pytest.skip(str(error))
    solver = make_backend("cpu", operator)
    rival.set_height(start)
    solver.set_height(start)
    dt = 0.7 * operator.stable_timestep
    # the solver drifts half a step before each kick and half a step after: the first half moves nothing, at a velocity
    # of 0, and the rival, which drifts a whole step after each kick, is taken back by the last half
    rival.advance(SUBSTEPS, dt)
    solver.advance(SUBSTEPS, dt)
    height, velocity = rival.state()
    assert np.abs(height - dt / 2 * velocity - solver.height()).max() < ROUND_OFF * np.abs(start).max()
    assert np.abs(velocity - solver.velocity()).max() < ROUND_OFF * np.abs(velocity).max()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_stream_passes_once_over_every_texel_each_substep(threads: int) -> None:
    stream = MemoryStream(5000, threads)
    s = stream.streams
    s.velocity[:], s.height[:] = np.arange(5000), 1.0
    for links, value in zip((s.east, s.north, s.northeast, s.northwest), (1.0, 2.0, 3.0, 4.0), strict=True):
        links[:] = value
    s.gain[:] = 0.5
    stream.advance(3, 0.25)
    kicked = np.arange(5000) + 3 * 0.25 * 0.5 * (1 + 2 + 3 + 4)
    assert np.allclose(s.velocity, kicked)
    assert np.allclose(s.next_height, 1 + 0.25 * kicked)


def test_stream_has_the_bytes_of_a_substep() -> None:
    """Read are 4 link weights, gain, height and velocity (28 bytes); written are velocity and next height (8 bytes)."""
    operator = build_operator(sphere_atlas(1.0, 16), Material(), "fem")
    texels = operator.mass.size
    stencil = operator.stencil.weights[..., 1:, 1:]  # one weight of each direction a texel
    fields = [stencil, operator.mass, operator.mass, operator.mass]
    assert sum(each.size for each in fields) == READS * texels
    streams = MemoryStream(texels).streams
    assert [each.nbytes for each in streams] == [4 * texels] * (READS + WRITES - 1)  # the velocity is both
