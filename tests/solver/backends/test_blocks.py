"""Several threads give the same bits as one."""

import numpy as np
import pytest
from features import FEATURES
from hand_made import polygon

from ripple_sim.solver import Material, sphere_atlas, texel_atlas
from ripple_sim.solver.backends.cpu import CPUBackend
from ripple_sim.solver.operator.assembly import build_operator


@pytest.mark.parametrize("feature", ["plain", "damping and density maps", "fixed"])
def test_threads_change_no_bit(feature: str) -> None:
    atlas = sphere_atlas(1.0, 48)  # three substeps a pass
    operator = build_operator(atlas, FEATURES[feature](atlas), "fem")
    start = np.random.default_rng(3).standard_normal(atlas.areas.shape).astype(np.float32)
    loaded = np.random.default_rng(4).choice(np.flatnonzero(operator.movable), 400, replace=False)

    def run(threads: int) -> bytes:
        backend = CPUBackend(operator, threads)  # one thread takes the plain pass over so small an atlas
        backend.set_height(start)
        for substeps in (1, 2, 7, 20):
            backend.load(loaded, np.linspace(-1, 1, 400), 0.01)
            backend.kick(loaded, np.ones(400, np.float32), -0.02)
            backend.advance(substeps, operator.stable_timestep)
        return backend.height().tobytes() + backend.velocity().tobytes()

    assert run(1) == run(2) == run(6)


def test_threads_change_no_bit_on_any_topology() -> None:
    texels = polygon(5, 33)  # two substeps a pass
    operator = build_operator(texel_atlas(texels), Material(speed=1.0), "fem")
    start = np.random.default_rng(1).standard_normal(texels.shape).astype(np.float32)
    heights = []
    for threads in (1, 2):
        backend = CPUBackend(operator, threads)
        backend.set_height(start)
        backend.advance(7, 0.9 * operator.stable_timestep)
        heights.append(backend.height())
    np.testing.assert_array_equal(*heights)
