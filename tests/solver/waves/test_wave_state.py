"""The state of waves: copies go on as the original does, and other solvers take it over."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas

MATERIAL = Material(speed=0.7, stiffness=30.0, viscosity=1e-3, density=2.0, yield_height=2e-3)


def hit(backend: str, material: Material = MATERIAL) -> WaveSolver:
    """Waves under a held force, with a dent and an impulse that came last."""
    waves = WaveSolver(sphere_atlas(1.0, 12), material, backend=backend, conserve_volume=False)
    waves.add_impulse([0, 0, 1], 0.4, 0.4)
    waves.add_force([1, 0, 0], 0.3, 0.4)
    waves.step(0.21)
    waves.add_impulse([0, 1, 0], 0.1, 0.4)
    return waves


def bits(waves: WaveSolver) -> tuple[bytes, ...]:
    return waves.height.tobytes(), waves.velocity.tobytes(), waves.dent.tobytes()


@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda waves: pickle.loads(pickle.dumps(waves))],
    ids=["copy", "deep", "pickle"],
)
def test_a_copy_goes_on_as_the_original_bit_for_bit(backend: str, copied: Callable[[WaveSolver], WaveSolver]) -> None:
    waves = hit(backend)
    twin, untouched = copied(waves), copied(waves)
    assert np.abs(waves.dent).max() > 1e-3
    before = bits(untouched)
    for each in (waves, twin):
        each.step(0.3)
        each.add_impulse([0, 1, 1], 0.2, 0.3)
        each.step(0.1)
    assert bits(twin) == bits(waves)
    assert (twin.time, twin.substeps_taken, twin.energy()) == (waves.time, waves.substeps_taken, waves.energy())
    assert bits(untouched) == before


def test_a_dent_stays_to_the_last_bit_in_a_surface_that_does_not_yield(backend: str) -> None:
    waves = hit(backend)
    dent = waves.dent
    elastic = WaveSolver(waves.atlas, Material(speed=0.7, stiffness=30.0), backend=backend)
    elastic.state = waves.state
    assert (elastic.height == waves.height).all()
    elastic.step(0.4)
    assert (elastic.dent == dent).all()
    elastic.height = 0.0
    assert not elastic.dent.any()


def test_what_is_clamped_or_rigid_takes_over_its_dent_alone(backend: str) -> None:
    waves = hit(backend)
    z = waves.atlas.positions[..., 2]
    other = WaveSolver(waves.atlas, Material(speed=np.where(z < 0, 0.0, 1.0), fixed=z > 0.5), backend=backend)
    other.state = waves.state
    rigid = ~other.operator.movable
    assert not other.velocity[rigid].any()
    before = other.height
    other.step(0.4)
    assert (other.height == before)[rigid].all()
    assert (other.height == other.dent)[z > 0.5].all()


def test_the_state_of_another_resolution_is_refused() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=r"shape \(6, 12, 12\); valid is \(6, 8, 8\)"):
        waves.state = hit("cpu").state
