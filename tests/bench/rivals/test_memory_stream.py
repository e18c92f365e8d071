"""The memory bound moves what a substep moves, once."""

import numpy as np
import pytest

from ripple_sim.bench.rivals import READS, WRITES, MemoryStream
from ripple_sim.solver import Material, sphere_atlas
from ripple_sim.solver.operator.assembly import build_operator


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
