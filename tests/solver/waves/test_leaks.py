"""Solvers leave nothing behind: memory, file descriptors and OpenGL objects."""

import gc
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import Material, WaveSolver, sphere_atlas

_PAGE = 4096


def resident() -> int:
    """Memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.parametrize("backend", ["cpu", "gl"])
def test_making_and_dropping_solvers_takes_no_more_and_more_memory(
    backend: str, opengl: None
) -> None:
    atlas = sphere_atlas(resolution=16)
    plate = Material(speed=1.0, viscosity=1e-3, bending=1e-4)  # which has three stencils

    def use(times: int) -> None:
        for _ in range(times):
            waves = WaveSolver(atlas, plate, backend=backend)
            waves.add_impulse([1.0, 0.0, 0.0], 1.0, 0.3)
            waves.step(0.01)
            assert np.isfinite(waves.height).all()
        del waves
        gc.collect()

    use(20)
    memory = resident()
    files = descriptors()
    use(60)
    assert descriptors() == files
    # one solver has fields of 6 x 16 x 16 float32 and three stencils: sixty that stay would be 6 MB
    # and more
    assert resident() - memory < 4e6
